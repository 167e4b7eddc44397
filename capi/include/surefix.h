/* The C interface of surefix: where am I on this route, and may I trust that answer?
 *
 * Every function that can fail returns a surefix_status, which is 0 if it did what it should, and
 * takes a pointer to a surefix_error as its last argument, or NULL: if it fails it writes there
 * what was expected and what came. A call that fails leaves its objects as they were. Nothing
 * unwinds into the caller, and no pointer to the caller's data is kept after a call. Text is UTF-8
 * and ends with a zero byte; so are paths, as bytes of any kind on Unix.
 *
 * Threads: a surefix_map may be used by any number of threads at once. A surefix_localizer and a
 * surefix_options may move between threads, but are for one at a time. To free an object while
 * another call uses it is an error that is not detected. */


#ifndef SUREFIX_H
#define SUREFIX_H

/* Written by cbindgen from capi/src: see capi/tests/header.rs. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// What became of a call.
typedef enum surefix_status {
  /// It did what it should.
  SUREFIX_STATUS_OK = 0,
  /// An argument or an option is not what it must be: NULL, an unknown name, outside its range.
  SUREFIX_STATUS_ARGUMENT = 1,
  /// The image or descriptor does not fit the map: its size, its type, a NaN. The next one may.
  SUREFIX_STATUS_DATA = 2,
  /// The system refused a file.
  SUREFIX_STATUS_FILE = 3,
  /// A file or a snapshot is damaged, of a newer version, or for another map.
  SUREFIX_STATUS_FORMAT = 4,
  /// Not enough memory.
  SUREFIX_STATUS_MEMORY = 5,
  /// Another thread is using this localizer.
  SUREFIX_STATUS_BUSY = 6,
  /// A defect of the library. The localizer that it happened in only says so from then on.
  SUREFIX_STATUS_INTERNAL = 7,
} surefix_status;

/// The type of the numbers of a descriptor.
typedef enum surefix_dtype {
  /// float.
  SUREFIX_DTYPE_F32 = 0,
  /// 16-bit floats (IEEE 754 binary16).
  SUREFIX_DTYPE_F16 = 1,
  /// int8_t.
  SUREFIX_DTYPE_I8 = 2,
  /// uint8_t.
  SUREFIX_DTYPE_U8 = 3,
} surefix_dtype;

/// How a camera lays a pixel out.
typedef enum surefix_pixels {
  /// One byte: brightness.
  SUREFIX_PIXELS_GREY8 = 0,
  /// Two bytes in the machine's order, as of a thermal camera. The map says which range of them
  /// is black to white.
  SUREFIX_PIXELS_GREY16 = 1,
  /// Three bytes: red, green, blue.
  SUREFIX_PIXELS_RGB8 = 2,
  /// Three bytes: blue, green, red, as of OpenCV.
  SUREFIX_PIXELS_BGR8 = 3,
  /// Four bytes: red, green, blue, and one that is not looked at.
  SUREFIX_PIXELS_RGBA8 = 4,
  /// Four bytes: blue, green, red, and one that is not looked at.
  SUREFIX_PIXELS_BGRA8 = 5,
} surefix_pixels;

/// Localizes along a map, one camera frame at a time.
typedef struct surefix_localizer surefix_localizer;

/// A known route, as `surefix map build` makes one. Any number of localizers can share it; each
/// holds a reference of its own, so that it may be freed before them.
typedef struct surefix_map surefix_map;

/// The options of a localizer, those of surefix.Localizer in Python: sequence_length, weight,
/// tolerance, smoothing, gradient, floor, speeds, motion; those of a motion, such as motion.pace;
/// and threads, the number of threads that scan the map.
typedef struct surefix_options surefix_options;

/// What went wrong in a call that failed. A call that does not fail leaves it alone.
typedef struct surefix_error {
  /// The status that the call returned.
  enum surefix_status status;
  /// What was expected, what came, and where. Cut if it is longer.
  char message[1020];
} surefix_error;

/// Where a place is.
typedef struct surefix_position {
  /// How many of the metres are known: 2 or 3, or 0 on a map without positions.
  size_t axes;
  /// Planar coordinates: east, north and height, if the plane is one of degrees. NaN if they are
  /// not known.
  double metres[3];
  /// Degrees (WGS84); NaN if the origin of the map's plane is not known.
  double latitude;
  /// Degrees (WGS84); NaN if the origin of the map's plane is not known.
  double longitude;
} surefix_position;

/// An image in the caller's memory, row by row from the top left. It is read during the call only.
typedef struct surefix_image {
  /// The first pixel.
  const void *pixels;
  /// Pixels a row.
  size_t width;
  /// Rows.
  size_t height;
  /// Bytes from one row to the next; 0 if no bytes lie between them.
  size_t stride;
  /// One of surefix_pixels.
  int32_t format;
} surefix_image;

/// Where the robot is, and whether to trust it. Numbers that are not known are NaN, with which
/// every comparison is false; places that are not known are SIZE_MAX.
typedef struct surefix_fix {
  /// The number of this query, from 0 since the start or the last reset.
  uint64_t frame;
  /// The track's place if there is motion; else the sequence's once it is ready, and before that
  /// the single match's.
  size_t place;
  /// The index of that place's segment: 0 on a route without breaks.
  size_t segment;
  /// That place, counted from its segment's first.
  size_t segment_place;
  /// Where that place is.
  struct surefix_position position;
  /// The score of that place: 1 - confidence of the track, the sequence's score, or the single
  /// match's distance. Less is better.
  float score;
  /// Whether place and score are those of the track or the sequence, not of one query alone.
  bool ready;
  /// Whether the single match is trusted.
  bool trusted;
  /// Whether the query shows nothing. It is never trusted, and says nothing of the place.
  bool blank;
  /// Whether there is a threshold, that of the settings' file, to judge by.
  bool judged;
  /// Whether the threshold accepts it; false without one.
  bool accepted;
  /// Whether the threshold's promise holds no longer, as scores are not those of its calibration
  /// drive any more; false without one.
  bool alarm;
  /// The probability that the place is right, by the threshold's calibration; NaN without one,
  /// and if the fix is not ready.
  double probability;
  /// The speed in places a query: the track's, else the sequence's; NaN without either.
  double speed;
  /// Whether there is a track: the option `motion` is set.
  bool has_track;
  /// The track's belief that the robot is within `tolerance` places of the place; NaN without
  /// one.
  double confidence;
  /// The track's belief that the robot is off the map; NaN without one.
  double off_map;
  /// The first place of the interval that holds 95 % of the belief on the map. On a route that is
  /// one closed segment it may go round: the first is then greater than the last. On more than
  /// 65,536 places, ends far from the place are rounded outwards, by up to 255 places.
  size_t interval_first;
  /// The last place of that interval.
  size_t interval_last;
  /// Whether there is a sequence: not for the first `sequence_length - 1` queries, nor after a
  /// gap.
  bool has_sequence;
  /// The sequence's place.
  size_t sequence_place;
  /// The mean of the weighted distances along the sequence's diagonal; less is better.
  float sequence_score;
  /// The trusted matches on the diagonal; 0 without a sequence.
  size_t sequence_anchors;
  /// The diagonal's slope, in places a query.
  double sequence_speed;
  /// The place at the smallest distance from this query alone.
  size_t single_place;
  /// That distance.
  float single_distance;
  /// The place of the enhanced gradient's peak.
  size_t gradient_place;
  /// The gradient there, in units of distance.
  float gradient_value;
} surefix_fix;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/// The version of the library, such as "0.1.0".
const char *surefix_version(void);

/// Reads a map's file into memory. Free the map with surefix_map_free.
///
/// Errors: SUREFIX_STATUS_FILE if the file cannot be read, SUREFIX_STATUS_FORMAT if it is no map or
/// a damaged one.
enum surefix_status surefix_map_open(const char *path,
                                     struct surefix_map **map,
                                     struct surefix_error *error);

/// Maps a map's file into memory instead: it is ready at once, whatever its size, processes share
/// its memory, and its rows are read from the disk as they are needed. As long as the map or a
/// localizer on it lives, the file must not be changed or made shorter (to put another one in its
/// place is safe); else the program may end with SIGBUS. Free the map with surefix_map_free.
///
/// Errors: as for surefix_map_open.
enum surefix_status surefix_map_open_mapped(const char *path,
                                            struct surefix_map **map,
                                            struct surefix_error *error);

/// Ends the caller's use of a map. Localizers go on with it. NULL is allowed.
void surefix_map_free(struct surefix_map *map);

/// The number of places, of which the first is 0; 0 for NULL.
size_t surefix_map_places(const struct surefix_map *map);

/// How many numbers a descriptor has that is pushed; 0 for NULL.
size_t surefix_map_descriptor_size(const struct surefix_map *map);

/// Whether images can be pushed: the map then describes them as its own were. If not, it was made
/// of descriptors that surefix cannot compute, such as a network's; push those.
bool surefix_map_takes_images(const struct surefix_map *map);

/// The size of the images that the map was made of, in pixels. Queries may have another, if they
/// show the same. False, with nothing written, if it is not known.
bool surefix_map_image_size(const struct surefix_map *map, size_t *width, size_t *height);

/// The name of a place, such as its image's file. It lives as long as the map is not freed. NULL if
/// the map has no names, or no such place.
const char *surefix_map_name(const struct surefix_map *map, size_t place);

/// Where a place is. On a map without positions it has 0 axes.
///
/// Errors: SUREFIX_STATUS_ARGUMENT if there is no such place.
enum surefix_status surefix_map_position(const struct surefix_map *map,
                                         size_t place,
                                         struct surefix_position *position,
                                         struct surefix_error *error);

/// The defaults. Free them with surefix_options_free; localizers that are made of them keep what
/// they need.
///
/// Errors: none but of a NULL.
enum surefix_status surefix_options_new(struct surefix_options **options,
                                        struct surefix_error *error);

/// Ends options. NULL is allowed.
void surefix_options_free(struct surefix_options *options);

/// Sets an option by its name. The value is text, as on the command line: "5" for sequence_length,
/// "0.9,1,1.1" for speeds, "steady", "free", "any" or "none" for motion.
///
/// Errors: SUREFIX_STATUS_ARGUMENT for an unknown name or a value of another kind. Ranges that
/// depend on the map are checked by surefix_localizer_new.
enum surefix_status surefix_options_set(struct surefix_options *options,
                                        const char *name,
                                        const char *value,
                                        struct surefix_error *error);

/// Sets an option that is a number.
///
/// Errors: as for surefix_options_set.
enum surefix_status surefix_options_set_number(struct surefix_options *options,
                                               const char *name,
                                               double value,
                                               struct surefix_error *error);

/// Takes the settings of a file, as `surefix tune` writes them (route.toml), in place of all that
/// was set but the threads: options, a threshold, and the map that they are for. Beside a threshold
/// no option can be changed.
///
/// Errors: SUREFIX_STATUS_FILE if the file cannot be read, SUREFIX_STATUS_FORMAT if it holds no
/// settings.
enum surefix_status surefix_options_load(struct surefix_options *options,
                                         const char *path,
                                         struct surefix_error *error);

/// A localizer on a map. Free it with surefix_localizer_free. Options may be NULL for the defaults.
/// All of its memory is allocated here but that for images, whose size the largest one sets. A map
/// of 16 MB or more is scanned by several threads, which the option `threads` limits.
///
/// Errors: SUREFIX_STATUS_ARGUMENT for an option outside its range, SUREFIX_STATUS_FORMAT for
/// settings of another map, SUREFIX_STATUS_MEMORY.
enum surefix_status surefix_localizer_new(const struct surefix_map *map,
                                          const struct surefix_options *options,
                                          struct surefix_localizer **localizer,
                                          struct surefix_error *error);

/// A localizer that goes on where a snapshot was taken, on the same map. Options are NULL for those
/// of the snapshot; else they must be the ones that it was taken with, and their threshold judges
/// from here on.
///
/// Errors: SUREFIX_STATUS_FORMAT if the bytes are damaged, of another map, of other options, or of
/// a newer version.
enum surefix_status surefix_localizer_restore(const struct surefix_map *map,
                                              const struct surefix_options *options,
                                              const uint8_t *snapshot,
                                              size_t size,
                                              struct surefix_localizer **localizer,
                                              struct surefix_error *error);

/// Ends a localizer. NULL is allowed.
void surefix_localizer_free(struct surefix_localizer *localizer);

/// Localizes by a camera image, described as the map's own were. It allocates nothing after the
/// first image of the largest size.
///
/// advance: NULL, or the places that the robot has moved since the query before, by odometry: 0 if
/// it stands still, negative if it reverses. It is metres times places per metre of the map.
///
/// Errors: SUREFIX_STATUS_DATA for an image that is none, and if the map takes descriptors;
/// SUREFIX_STATUS_ARGUMENT for an advance that is not finite. The fix is then left alone.
enum surefix_status surefix_push_image(struct surefix_localizer *localizer,
                                       const struct surefix_image *image,
                                       const double *advance,
                                       struct surefix_fix *fix,
                                       struct surefix_error *error);

/// Localizes by a descriptor of surefix_map_descriptor_size numbers, of the map's own type, or
/// float on a map that takes no images. It allocates nothing.
///
/// type: one of surefix_dtype. advance: as for surefix_push_image.
///
/// Errors: SUREFIX_STATUS_DATA for another number of values, another type, a NaN or an infinity;
/// SUREFIX_STATUS_ARGUMENT for an advance that is not finite, or a pointer that the numbers' size
/// does not divide. The fix is then left alone.
enum surefix_status surefix_push_descriptor(struct surefix_localizer *localizer,
                                            const void *values,
                                            size_t count,
                                            int32_t type,
                                            const double *advance,
                                            struct surefix_fix *fix,
                                            struct surefix_error *error);

/// Says that the next frame does not follow on the one before, as after lost frames: fixes have no
/// sequence until it is full again. advance: NULL, or the places that the robot moved meanwhile.
///
/// Errors: SUREFIX_STATUS_ARGUMENT for an advance that is not finite.
enum surefix_status surefix_gap(struct surefix_localizer *localizer,
                                const double *advance,
                                struct surefix_error *error);

/// Forgets all frames: the next one is frame 0.
///
/// Errors: none but of a NULL or a busy localizer.
enum surefix_status surefix_reset(struct surefix_localizer *localizer, struct surefix_error *error);

/// The state as bytes, without the map, for surefix_localizer_restore: fixes go on with the same
/// bits. Free them with surefix_snapshot_free.
///
/// Errors: none but of a NULL or a busy localizer.
enum surefix_status surefix_snapshot(const struct surefix_localizer *localizer,
                                     uint8_t **snapshot,
                                     size_t *size,
                                     struct surefix_error *error);

/// Ends the bytes of a snapshot, whose size must be the one that came with them. NULL is allowed.
void surefix_snapshot_free(uint8_t *snapshot, size_t size);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SUREFIX_H */
