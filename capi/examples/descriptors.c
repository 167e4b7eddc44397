/* Localizes by a network's descriptors: descriptors MAP NUMBERS
 *
 * NUMBERS is a file of floats in the machine's order, descriptor by descriptor; it stands in for
 * the network. The state is kept in memory half way, and taken up again as after a restart. */

#include <stdio.h>
#include <stdlib.h>
#include <surefix.h>

static surefix_error error;

static int failed(const char *what) {
  fprintf(stderr, "descriptors: %s: %s\n", what, error.message);
  return 1;
}

/* Ends the localizer, and makes one that goes on in its place. */
static surefix_status restart(const surefix_map *map, surefix_localizer **localizer) {
  uint8_t *snapshot = NULL;
  size_t size = 0;
  surefix_status status = surefix_snapshot(*localizer, &snapshot, &size, &error);
  if (status == SUREFIX_STATUS_OK) {
    surefix_localizer_free(*localizer);
    *localizer = NULL;
    status = surefix_localizer_restore(map, NULL, snapshot, size, localizer, &error);
  }
  surefix_snapshot_free(snapshot, size);
  return status;
}

static int localize(const surefix_map *map, surefix_localizer **localizer, FILE *file) {
  const size_t size = surefix_map_descriptor_size(map);
  float *values = malloc(size * sizeof *values);
  int code = values == NULL;
  while (code == 0 && fread(values, sizeof *values, size, file) == size) {
    const double advance = 1.0; /* by the wheels: metres times places per metre */
    surefix_fix fix;
    if (surefix_push_descriptor(*localizer, values, size, SUREFIX_DTYPE_F32, &advance, &fix,
                                &error) != SUREFIX_STATUS_OK) {
      code = failed("push");
    } else {
      printf("%zu,%.17g,%.17g,%.17g\n", fix.place, (double)fix.score, fix.confidence, fix.off_map);
      const int half_way = 2 * fix.frame == surefix_map_places(map);
      if (half_way && restart(map, localizer) != SUREFIX_STATUS_OK) {
        code = failed("restart");
      }
    }
  }
  free(values);
  return code;
}

int main(int count, char **words) {
  surefix_map *map = NULL;
  surefix_options *options = NULL;
  surefix_localizer *localizer = NULL;
  FILE *file = count == 3 ? fopen(words[2], "rb") : NULL;
  int code;
  if (file == NULL) {
    fprintf(stderr, "usage: descriptors MAP NUMBERS\n");
    return 2;
  }
  if (surefix_map_open(words[1], &map, &error) != SUREFIX_STATUS_OK) {
    code = failed("map");
  } else if (surefix_options_new(&options, &error) != SUREFIX_STATUS_OK ||
             surefix_options_set(options, "motion", "steady", &error) != SUREFIX_STATUS_OK ||
             surefix_options_set_number(options, "sequence_length", 5, &error) !=
                 SUREFIX_STATUS_OK) {
    code = failed("options");
  } else if (surefix_localizer_new(map, options, &localizer, &error) != SUREFIX_STATUS_OK) {
    code = failed("localizer");
  } else {
    code = localize(map, &localizer, file);
  }
  surefix_localizer_free(localizer);
  surefix_options_free(options);
  surefix_map_free(map);
  fclose(file);
  return code;
}
