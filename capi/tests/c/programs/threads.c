/* Two threads with a localizer each on one map, then two with one localizer: threads MAP [apart]
 *
 * With a third word, the second part is left out: ThreadSanitizer sees the library's calls of
 * memcpy there, but not the atomic flag that keeps them apart: the library is not built with it. */

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <surefix.h>

enum { FRAMES = 200, WIDTH = 64, HEIGHT = 32 };

static uint8_t frames[FRAMES][WIDTH * HEIGHT];

struct work {
  surefix_localizer *localizer;
  surefix_fix fixes[FRAMES];
  int busy, failed;
};

static void *run(void *given) {
  struct work *work = given;
  int frame = 0;
  while (frame < FRAMES) {
    surefix_error error;
    const surefix_image image = {frames[frame], WIDTH, HEIGHT, 0, SUREFIX_PIXELS_GREY8};
    const surefix_status status =
        surefix_push_image(work->localizer, &image, NULL, &work->fixes[frame], &error);
    if (status == SUREFIX_STATUS_BUSY) {
      /* The other thread has it: again, and again. */
      work->failed += strstr(error.message, "in use by another thread") == NULL;
      ++work->busy;
    } else {
      work->failed += status != SUREFIX_STATUS_OK;
      ++frame;
    }
  }
  return NULL;
}

static void both(struct work *works) {
  pthread_t threads[2];
  pthread_create(&threads[0], NULL, run, &works[0]);
  pthread_create(&threads[1], NULL, run, &works[1]);
  pthread_join(threads[0], NULL);
  pthread_join(threads[1], NULL);
}

int main(int count, char **words) {
  static struct work works[4];
  surefix_map *map = NULL;
  int index, failed = 0;
  uint32_t random = 1;
  if (count < 2 || surefix_map_open(words[1], &map, NULL) != SUREFIX_STATUS_OK) {
    return 2;
  }
  for (index = 0; index < FRAMES * WIDTH * HEIGHT; ++index) {
    random = random * 1664525u + 1013904223u;
    frames[index / (WIDTH * HEIGHT)][index % (WIDTH * HEIGHT)] = (uint8_t)(random >> 24);
  }
  for (index = 0; index < 4; ++index) {
    failed += surefix_localizer_new(map, NULL, &works[index].localizer, NULL) != SUREFIX_STATUS_OK;
  }
  /* The localizers hold it. */
  surefix_map_free(map);
  run(&works[0]);
  both(&works[1]);
  for (index = 0; index < FRAMES; ++index) {
    const surefix_fix *alone = &works[0].fixes[index];
    int thread;
    for (thread = 1; thread < 3; ++thread) {
      const surefix_fix *together = &works[thread].fixes[index];
      failed += together->place != alone->place || together->score != alone->score;
    }
  }
  for (index = 0; index < 3; ++index) {
    failed += works[index].failed + works[index].busy;
  }
  if (count == 2) {
    static struct work shared[2];
    surefix_fix last;
    const surefix_image image = {frames[0], WIDTH, HEIGHT, 0, SUREFIX_PIXELS_GREY8};
    shared[0].localizer = shared[1].localizer = works[3].localizer;
    both(shared);
    /* No push is lost, and none is done twice. */
    failed += shared[0].failed + shared[1].failed;
    failed += surefix_push_image(works[3].localizer, &image, NULL, &last, NULL) != 0;
    failed += last.frame != 2 * FRAMES;
    printf("%d pushes were refused\n", shared[0].busy + shared[1].busy);
  }
  for (index = 0; index < 4; ++index) {
    surefix_localizer_free(works[index].localizer);
  }
  return failed == 0 ? 0 : 1;
}
