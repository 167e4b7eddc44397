/* Two threads with a localizer each on one map, then two with one localizer: threads MAP */

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
  int done, busy, failed;
};

static void *run(void *given) {
  struct work *work = given;
  int frame;
  for (frame = 0; frame < FRAMES; ++frame) {
    surefix_error error;
    const surefix_image image = {frames[frame], WIDTH, HEIGHT, 0, SUREFIX_PIXELS_GREY8};
    const surefix_status status =
        surefix_push_image(work->localizer, &image, NULL, &work->fixes[frame], &error);
    work->done += status == SUREFIX_STATUS_OK;
    work->busy += status == SUREFIX_STATUS_BUSY;
    if (status == SUREFIX_STATUS_BUSY) {
      work->failed += strstr(error.message, "in use by another thread") == NULL;
    } else {
      work->failed += status != SUREFIX_STATUS_OK;
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
  if (count != 2 || surefix_map_open(words[1], &map, NULL) != SUREFIX_STATUS_OK) {
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
  failed += works[0].done + works[1].done + works[2].done != 3 * FRAMES;
  /* One localizer for two threads: each push is done or refused, and none is lost. */
  {
    static struct work shared[2];
    surefix_fix last;
    const surefix_image image = {frames[0], WIDTH, HEIGHT, 0, SUREFIX_PIXELS_GREY8};
    shared[0].localizer = shared[1].localizer = works[3].localizer;
    both(shared);
    failed += shared[0].failed + shared[1].failed;
    failed += surefix_push_image(works[3].localizer, &image, NULL, &last,
                                 NULL) != SUREFIX_STATUS_OK;
    failed += last.frame != (uint64_t)(shared[0].done + shared[1].done);
    printf("%d pushes, %d refused\n", shared[0].done + shared[1].done,
           shared[0].busy + shared[1].busy);
  }
  for (index = 0; index < 4; ++index) {
    surefix_localizer_free(works[index].localizer);
  }
  return failed == 0 ? 0 : 1;
}
