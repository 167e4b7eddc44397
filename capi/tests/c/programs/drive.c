/* Does what standard input says, and prints all of each fix: drive MAP
 *
 * set NAME VALUE | number NAME VALUE | load FILE | start: before the first push
 * image FILE WIDTH HEIGHT STRIDE FORMAT ADVANCE | values FILE COUNT TYPE ADVANCE
 * gap ADVANCE | reset | restart
 *
 * ADVANCE is a number, or - if it is not known. Numbers are printed as their bits. */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <surefix.h>

static surefix_error error;
static surefix_map *map;
static surefix_options *options;
static surefix_localizer *localizer;

static void demand(int done, const char *what) {
  if (!done) {
    fprintf(stderr, "drive: %s: %s\n", what, error.message);
    exit(1);
  }
}

static void ok(surefix_status status, const char *what) {
  demand(status == SUREFIX_STATUS_OK, what);
}

static void number(double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  printf(" %016" PRIx64, bits);
}

static void small(float value) {
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  printf(" %08" PRIx32, bits);
}

static void show(const surefix_fix *fix) {
  printf("%" PRIu64 " %zu %zu %zu", fix->frame, fix->place, fix->segment, fix->segment_place);
  printf(" %zu", fix->position.axes);
  number(fix->position.metres[0]);
  number(fix->position.metres[1]);
  number(fix->position.metres[2]);
  number(fix->position.latitude);
  number(fix->position.longitude);
  small(fix->score);
  printf(" %d %d %d", fix->ready, fix->trusted, fix->blank);
  printf(" %d %d %d", fix->judged, fix->accepted, fix->alarm);
  number(fix->probability);
  number(fix->speed);
  printf(" %d", fix->has_track);
  number(fix->confidence);
  number(fix->off_map);
  printf(" %zu %zu", fix->interval_first, fix->interval_last);
  printf(" %d %zu", fix->has_sequence, fix->sequence_place);
  small(fix->sequence_score);
  printf(" %zu", fix->sequence_anchors);
  number(fix->sequence_speed);
  printf(" %zu", fix->single_place);
  small(fix->single_distance);
  printf(" %zu", fix->gradient_place);
  small(fix->gradient_value);
  putchar('\n');
}

static void *contents(const char *name) {
  FILE *file = fopen(name, "rb");
  long size;
  void *bytes;
  demand(file != NULL && fseek(file, 0, SEEK_END) == 0, name);
  size = ftell(file);
  rewind(file);
  bytes = malloc((size_t)size);
  demand(bytes != NULL && fread(bytes, 1, (size_t)size, file) == (size_t)size, name);
  fclose(file);
  return bytes;
}

static void push(const char *line) {
  char name[512], advance[64];
  double moved;
  const double *known;
  surefix_image image;
  size_t count = 0;
  int type = 0;
  surefix_fix fix;
  void *bytes;
  const int is_image = sscanf(line, "image %511s %zu %zu %zu %" SCNd32 " %63s", name, &image.width,
                              &image.height, &image.stride, &image.format, advance) == 6;
  demand(is_image || sscanf(line, "values %511s %zu %d %63s", name, &count, &type, advance) == 4,
         line);
  moved = atof(advance);
  known = strcmp(advance, "-") == 0 ? NULL : &moved;
  bytes = contents(name);
  image.pixels = bytes;
  if (is_image) {
    ok(surefix_push_image(localizer, &image, known, &fix, &error), line);
  } else {
    ok(surefix_push_descriptor(localizer, bytes, count, type, known, &fix, &error), line);
  }
  free(bytes);
  show(&fix);
}

static void restart(void) {
  uint8_t *snapshot;
  size_t size;
  ok(surefix_snapshot(localizer, &snapshot, &size, &error), "snapshot");
  surefix_localizer_free(localizer);
  ok(surefix_localizer_restore(map, options, snapshot, size, &localizer, &error), "restore");
  surefix_snapshot_free(snapshot, size);
}

int main(int count, char **words) {
  char line[1024], name[64], value[512];
  demand(count == 2, "expected a map");
  ok(surefix_map_open_mapped(words[1], &map, &error), words[1]);
  ok(surefix_options_new(&options, &error), "options");
  while (fgets(line, sizeof line, stdin) != NULL) {
    if (sscanf(line, "set %63s %511s", name, value) == 2) {
      ok(surefix_options_set(options, name, value, &error), line);
    } else if (sscanf(line, "number %63s %511s", name, value) == 2) {
      ok(surefix_options_set_number(options, name, atof(value), &error), line);
    } else if (sscanf(line, "load %511s", value) == 1) {
      ok(surefix_options_load(options, value, &error), line);
    } else if (strcmp(line, "start\n") == 0) {
      ok(surefix_localizer_new(map, options, &localizer, &error), "localizer");
    } else if (strcmp(line, "reset\n") == 0) {
      ok(surefix_reset(localizer, &error), "reset");
    } else if (strcmp(line, "restart\n") == 0) {
      restart();
    } else if (sscanf(line, "gap %63s", value) == 1) {
      const double moved = atof(value);
      ok(surefix_gap(localizer, strcmp(value, "-") == 0 ? NULL : &moved, &error), line);
    } else {
      push(line);
    }
  }
  surefix_options_free(options);
  surefix_localizer_free(localizer);
  surefix_map_free(map);
  return 0;
}
