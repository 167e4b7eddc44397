/* What a caller can do wrong: misuse MAP OTHER DESCRIPTORS FOLDER
 *
 * MAP and OTHER take images of 64 x 32, DESCRIPTORS takes float descriptors. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <surefix.h>

static surefix_error error;
static int failures;

/* The call fails with this status, and its message has these words. */
#define FAILS(call, expected, words)                                                              \
  do {                                                                                            \
    surefix_status status;                                                                        \
    memset(&error, 'x', sizeof error);                                                            \
    status = (call);                                                                              \
    if (status != (expected) || error.status != (expected) ||                                     \
        memchr(error.message, 0, sizeof error.message) == NULL ||                                 \
        strstr(error.message, (words)) == NULL) {                                                 \
      fprintf(stderr, "line %d: status %d, %.200s\n", __LINE__, (int)status, error.message);      \
      ++failures;                                                                                 \
    }                                                                                             \
  } while (0)
#define HOLDS(fact)                                                                               \
  do {                                                                                            \
    if (!(fact)) {                                                                                \
      fprintf(stderr, "line %d: not so: %s (%.200s)\n", __LINE__, #fact, error.message);          \
      ++failures;                                                                                 \
    }                                                                                             \
  } while (0)
#define DOES(call) HOLDS((call) == SUREFIX_STATUS_OK)

#define ARGUMENT SUREFIX_STATUS_ARGUMENT
#define DATA SUREFIX_STATUS_DATA
#define FORMAT SUREFIX_STATUS_FORMAT

static void maps(char **words) {
  surefix_map *map = NULL;
  surefix_position at;
  size_t width = 7, height = 7;
  char name[3000];
  FAILS(surefix_map_open(NULL, &map, &error), ARGUMENT, "path: expected a pointer, got NULL");
  FAILS(surefix_map_open(words[1], NULL, &error), ARGUMENT, "got NULL");
  FAILS(surefix_map_open("nowhere", &map, &error), SUREFIX_STATUS_FILE,
        "nowhere: cannot read the map");
  FAILS(surefix_map_open_mapped("nowhere", &map, &error), SUREFIX_STATUS_FILE, "nowhere");
  FAILS(surefix_map_open(words[0], &map, &error), FORMAT, "not a usable surefix map");
  FAILS(surefix_map_open_mapped(words[0], &map, &error), FORMAT, "not a usable surefix map");
  FAILS(surefix_map_open(words[4], &map, &error), SUREFIX_STATUS_FILE, "directory");
  /* A message that is too long is cut. */
  memset(name, 'n', sizeof name);
  name[sizeof name - 1] = 0;
  FAILS(surefix_map_open(name, &map, &error), SUREFIX_STATUS_FILE, "n...");
  HOLDS(map == NULL && surefix_map_open("nowhere", &map, NULL) == SUREFIX_STATUS_FILE);
  HOLDS(surefix_map_places(NULL) == 0 && surefix_map_descriptor_size(NULL) == 0);
  HOLDS(!surefix_map_takes_images(NULL) && !surefix_map_image_size(NULL, &width, &height));
  HOLDS(surefix_map_name(NULL, 0) == NULL && width == 7);
  surefix_map_free(NULL);

  DOES(surefix_map_open(words[1], &map, &error));
  HOLDS(surefix_map_takes_images(map) && surefix_map_image_size(map, &width, &height));
  HOLDS(width == 64 && height == 32 && !surefix_map_image_size(map, NULL, &height));
  HOLDS(strcmp(surefix_map_name(map, 3), "3") == 0);
  HOLDS(surefix_map_name(map, surefix_map_places(map)) == NULL);
  HOLDS(surefix_map_name(map, SIZE_MAX) == NULL);
  DOES(surefix_map_position(map, 3, &at, &error));
  HOLDS(at.axes == 2 && at.metres[0] == 9.0 && at.metres[1] == 3.0 && isnan(at.metres[2]));
  HOLDS(fabs(at.latitude + 27.47) < 1e-3 && fabs(at.longitude - 153.02) < 1e-3);
  FAILS(surefix_map_position(map, SIZE_MAX, &at, &error), ARGUMENT,
        "place: expected one from 0 to");
  FAILS(surefix_map_position(map, 0, NULL, &error), ARGUMENT, "position: expected a pointer");
  FAILS(surefix_map_position(NULL, 0, &at, &error), ARGUMENT, "map: expected a pointer");
  surefix_map_free(map);
  DOES(surefix_map_open(words[3], &map, &error));
  HOLDS(!surefix_map_takes_images(map) && surefix_map_name(map, 0) == NULL);
  DOES(surefix_map_position(map, 0, &at, &error));
  HOLDS(at.axes == 0 && isnan(at.metres[0]) && isnan(at.latitude));
  surefix_map_free(map);
}

static void options(const surefix_map *map) {
  surefix_options *options = NULL;
  surefix_localizer *localizer = NULL;
  surefix_options_free(NULL);
  FAILS(surefix_options_new(NULL, &error), ARGUMENT, "got NULL");
  DOES(surefix_options_new(&options, &error));
  FAILS(surefix_options_set(NULL, "motion", "any", &error), ARGUMENT, "options: expected");
  FAILS(surefix_options_set(options, NULL, "any", &error), ARGUMENT, "name: expected");
  FAILS(surefix_options_set(options, "motion", NULL, &error), ARGUMENT, "value: expected");
  FAILS(surefix_options_set(options, "\xff", "1", &error), ARGUMENT, "name: expected UTF-8");
  FAILS(surefix_options_set(options, "speed", "1", &error), ARGUMENT,
        "motion, sequence_length, smoothing, speeds");
  FAILS(surefix_options_set(options, "motion.speed", "1", &error), ARGUMENT, "motion.speeds");
  FAILS(surefix_options_set(options, "motion", "fast", &error), ARGUMENT, "option `motion`: ");
  FAILS(surefix_options_set(options, "motion", "1", &error), ARGUMENT, "steady, free, any");
  FAILS(surefix_options_set(options, "motion.pace", "-1", &error), ARGUMENT, "motion.pace");
  FAILS(surefix_options_set(options, "gradient", "third", &error), ARGUMENT, "halved");
  FAILS(surefix_options_set(options, "floor", "roof", &error), ARGUMENT, "running");
  FAILS(surefix_options_set(options, "sequence_length", "2.5", &error), ARGUMENT,
        "expected a whole number of 0 or more, got \"2.5\"");
  FAILS(surefix_options_set(options, "speeds", "1,fast", &error), ARGUMENT, "commas");
  FAILS(surefix_options_set_number(options, "weight", NAN, &error), ARGUMENT, "weight");
  FAILS(surefix_options_set_number(options, "gradient", 1, &error), ARGUMENT, "halved or unhalved");
  FAILS(surefix_options_set_number(options, "threads", -1, &error), ARGUMENT, "threads");
  FAILS(surefix_options_set_number(options, NULL, 1, &error), ARGUMENT, "name");
  FAILS(surefix_options_load(options, "nowhere.toml", &error), SUREFIX_STATUS_FILE, "nowhere.toml");
  FAILS(surefix_options_load(options, NULL, &error), ARGUMENT, "path");
  FAILS(surefix_localizer_new(NULL, options, &localizer, &error), ARGUMENT, "map");
  FAILS(surefix_localizer_new(map, options, NULL, &error), ARGUMENT, "out");
  DOES(surefix_options_set_number(options, "sequence_length", 1e9, &error));
  FAILS(surefix_localizer_new(map, options, &localizer, &error), ARGUMENT,
        "option `sequence_length`");
  DOES(surefix_options_set(options, "sequence_length", "3", &error));
  DOES(surefix_options_set(options, "threads", "0", &error));
  FAILS(surefix_localizer_new(map, options, &localizer, &error), ARGUMENT, "option `threads`");
  DOES(surefix_options_set(options, "threads", "2", &error));
  DOES(surefix_localizer_new(map, options, &localizer, &error));
  surefix_options_free(options);
  surefix_localizer_free(localizer);
}

static void images(surefix_localizer *localizer) {
  static uint8_t pixels[64 * 32 * 4];
  surefix_image image = {pixels, 64, 32, 0, SUREFIX_PIXELS_RGB8};
  surefix_fix fix;
  double advance = NAN;
  fix.frame = 77;
  FAILS(surefix_push_image(NULL, &image, NULL, &fix, &error), ARGUMENT, "localizer");
  FAILS(surefix_push_image(localizer, NULL, NULL, &fix, &error), ARGUMENT, "image: expected");
  FAILS(surefix_push_image(localizer, &image, NULL, NULL, &error), ARGUMENT, "fix");
  FAILS(surefix_push_image(localizer, &image, &advance, &fix, &error), ARGUMENT, "advance");
  FAILS(surefix_gap(localizer, &advance, &error), ARGUMENT, "advance");
  FAILS(surefix_gap(NULL, NULL, &error), ARGUMENT, "localizer");
  FAILS(surefix_reset(NULL, &error), ARGUMENT, "localizer");
  image.pixels = NULL;
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), ARGUMENT, "pixels: expected");
  image.pixels = pixels;
  image.stride = 64 * 3 - 1;
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), DATA,
        "a stride of 192 bytes or more");
  image.stride = 0;
  image.format = 6;
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), ARGUMENT, "0 to 5, got 6");
  image.format = -1;
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), ARGUMENT, "got -1");
  image.format = SUREFIX_PIXELS_GREY16;
  image.height = 0;
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), DATA, "64 x 0");
  image.height = SIZE_MAX;
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), DATA,
        "sides of 1 to 65535 pixels");
  image.height = 32;
  image.stride = SIZE_MAX / 31;
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), DATA,
        "a stride that fits into memory");
  image.stride = SIZE_MAX / 40;
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), ARGUMENT, "fewer");
  FAILS(surefix_push_descriptor(localizer, pixels, 9, SUREFIX_DTYPE_U8, NULL, &fix, &error), DATA,
        "9");
  HOLDS(fix.frame == 77);
  /* After all that it is as it was. */
  image.stride = 0;
  DOES(surefix_push_image(localizer, &image, NULL, &fix, &error));
  HOLDS(fix.frame == 0 && fix.blank && !fix.trusted);
}

static void descriptors(char **words) {
  surefix_map *map = NULL;
  surefix_localizer *localizer = NULL;
  surefix_fix fix;
  surefix_image image = {"pixels", 2, 3, 0, SUREFIX_PIXELS_GREY8};
  float values[9] = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  const char *bytes = (const char *)values;
  DOES(surefix_map_open(words[3], &map, &error));
  HOLDS(surefix_map_descriptor_size(map) == 8);
  DOES(surefix_localizer_new(map, NULL, &localizer, &error));
  surefix_map_free(map);
  FAILS(surefix_push_image(localizer, &image, NULL, &fix, &error), DATA, "ready descriptors");
  FAILS(surefix_push_descriptor(localizer, NULL, 8, SUREFIX_DTYPE_F32, NULL, &fix, &error),
        ARGUMENT,
        "descriptor: expected a pointer");
  FAILS(surefix_push_descriptor(localizer, values, 7, SUREFIX_DTYPE_F32, NULL, &fix, &error), DATA,
        "expected 8 values, got 7");
  FAILS(surefix_push_descriptor(localizer, values, 0, SUREFIX_DTYPE_F32, NULL, &fix, &error),
        DATA, "got 0");
  FAILS(surefix_push_descriptor(localizer, values, SIZE_MAX, SUREFIX_DTYPE_F32, NULL, &fix, &error),
        ARGUMENT, "fewer");
  FAILS(surefix_push_descriptor(localizer, values, 8, SUREFIX_DTYPE_I8, NULL, &fix, &error), DATA,
        "int8");
  FAILS(surefix_push_descriptor(localizer, values, 8, 4, NULL, &fix, &error), ARGUMENT, "got 4");
  FAILS(surefix_push_descriptor(localizer, bytes + 1, 8, SUREFIX_DTYPE_F32, NULL, &fix, &error),
        ARGUMENT, "an address that 4 divides");
  values[5] = NAN;
  FAILS(surefix_push_descriptor(localizer, values, 8, SUREFIX_DTYPE_F32, NULL, &fix, &error), DATA,
        "index 5");
  values[5] = 6;
  DOES(surefix_push_descriptor(localizer, values, 8, SUREFIX_DTYPE_F32, NULL, &fix, NULL));
  HOLDS(fix.frame == 0);
  surefix_localizer_free(localizer);
}

static void snapshots(const surefix_map *map, surefix_localizer *localizer, char **words) {
  surefix_map *other = NULL;
  surefix_options *options = NULL;
  surefix_localizer *restored = NULL;
  uint8_t *snapshot = NULL;
  size_t size = 0;
  FAILS(surefix_snapshot(NULL, &snapshot, &size, &error), ARGUMENT, "localizer");
  FAILS(surefix_snapshot(localizer, NULL, &size, &error), ARGUMENT, "snapshot");
  FAILS(surefix_snapshot(localizer, &snapshot, NULL, &error), ARGUMENT, "size");
  DOES(surefix_snapshot(localizer, &snapshot, &size, &error));
  FAILS(surefix_localizer_restore(map, NULL, NULL, size, &restored, &error), ARGUMENT, "snapshot");
  FAILS(surefix_localizer_restore(map, NULL, snapshot, 0, &restored, &error), FORMAT, "snapshot");
  FAILS(surefix_localizer_restore(map, NULL, snapshot, size - 1, &restored, &error), FORMAT,
        "snapshot");
  DOES(surefix_map_open(words[2], &other, &error));
  FAILS(surefix_localizer_restore(other, NULL, snapshot, size, &restored, &error), FORMAT,
        "snapshot");
  DOES(surefix_options_new(&options, &error));
  DOES(surefix_options_set(options, "weight", "0.5", &error));
  FAILS(surefix_localizer_restore(map, options, snapshot, size, &restored, &error), FORMAT,
        "weight");
  snapshot[size / 2] ^= 1;
  FAILS(surefix_localizer_restore(map, NULL, snapshot, size, &restored, &error), FORMAT,
        "snapshot");
  HOLDS(restored == NULL);
  snapshot[size / 2] ^= 1;
  DOES(surefix_localizer_restore(map, NULL, snapshot, size, &restored, &error));
  surefix_snapshot_free(snapshot, size);
  surefix_snapshot_free(NULL, 0);
  surefix_localizer_free(restored);
  surefix_localizer_free(NULL);
  surefix_options_free(options);
  surefix_map_free(other);
}

int main(int count, char **words) {
  surefix_map *map = NULL;
  surefix_localizer *localizer = NULL;
  if (count != 5) {
    return 2;
  }
  maps(words);
  DOES(surefix_map_open(words[1], &map, &error));
  options(map);
  DOES(surefix_localizer_new(map, NULL, &localizer, &error));
  images(localizer);
  descriptors(words);
  snapshots(map, localizer, words);
  surefix_localizer_free(localizer);
  surefix_map_free(map);
  return failures == 0 ? 0 : 1;
}
