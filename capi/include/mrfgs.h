/* mrfgs: stereo disparity with the same bits on every device.
 *
 * Match frames in your memory, into maps in your memory:
 *
 *     mrfgs_options *options = mrfgs_options_new();
 *     mrfgs_options_preset(options, "fast");
 *     mrfgs_matcher *matcher;
 *     if (mrfgs_matcher_new(options, &matcher) != MRFGS_STATUS_OK) fail(mrfgs_last_error());
 *     mrfgs_image left = {pixels, stride, width, height, MRFGS_FORMAT_GREY8}, right = ...;
 *     mrfgs_range range = {0, 63};
 *     mrfgs_maps maps = {.size = sizeof maps, .disparity = disparity, .disparity_stride = width * sizeof(float)};
 *     if (mrfgs_match(matcher, &left, &right, &range, &maps) != MRFGS_STATUS_OK) fail(mrfgs_last_error());
 *
 * Errors: a call that can fail returns a status, and mrfgs_last_error() says in words what was wrong. Nothing is written to maps then.
 * Threads: calls may come from any thread. Matches of one matcher take turns; matchers do not wait for each other. Options are not
 * to be changed by two threads at once.
 * Pointers: what a call takes stays the caller's, and is not kept after the call. A null pointer is an error, and no crash, unless a
 * function says that it may be null. What mrfgs_..._new() made is freed by mrfgs_..._free(), once, when nobody uses it any more.
 * Texts are UTF-8 and end with a 0.
 * Versions: a program that was built with this header works with every later library of the same soname. Fields may be added to
 * mrfgs_maps, which says its size; nothing is added to the other structures. */

#ifndef MRFGS_H
#define MRFGS_H

/* Made by cbindgen from capi/src: scripts/c --header makes it anew. */

#include <stddef.h>
#include <stdint.h>

// How a call ended.
typedef enum mrfgs_status {
  // It did what it should.
  MRFGS_STATUS_OK = 0,
  // An argument makes no sense, or arguments do not fit each other.
  MRFGS_STATUS_ARGUMENT = 1,
  // A file cannot be read.
  MRFGS_STATUS_FILE = 2,
  // There is no device, or the one that there is failed.
  MRFGS_STATUS_DEVICE = 3,
  // The machine or the device has not enough memory.
  MRFGS_STATUS_MEMORY = 4,
  // mrfgs_matcher_stop() ended the match.
  MRFGS_STATUS_STOPPED = 5,
  // The library is at fault. Please report it.
  MRFGS_STATUS_DEFECT = 6,
} mrfgs_status;

// How the pixels of an image are stored. Samples of 16 bits are in the byte order of the machine; they fill their range with the
// largest value of both images. A pixel whose alpha is 0 is ignored.
enum mrfgs_format
#ifdef __cplusplus
  : uint32_t
#endif // __cplusplus
 {
  // Grey, 8 bits.
  MRFGS_FORMAT_GREY8 = 1,
  // Grey, 16 bits.
  MRFGS_FORMAT_GREY16 = 2,
  // Red, green and blue, 8 bits each.
  MRFGS_FORMAT_RGB8 = 3,
  // Red, green and blue, 16 bits each.
  MRFGS_FORMAT_RGB16 = 4,
  // Red, green, blue and alpha, 8 bits each.
  MRFGS_FORMAT_RGBA8 = 5,
  // Red, green, blue and alpha, 16 bits each.
  MRFGS_FORMAT_RGBA16 = 6,
};
#ifndef __cplusplus
typedef uint32_t mrfgs_format;
#endif // __cplusplus

// Why a pixel is what it is: bits of the validity map. A pixel of 0 is measured and trusted.
enum mrfgs_flag
#ifdef __cplusplus
  : uint8_t
#endif // __cplusplus
 {
  // The match is outside the right image.
  MRFGS_FLAG_OUTSIDE = 1,
  // The right view disagrees: occluded, or mistaken.
  MRFGS_FLAG_OCCLUDED = 2,
  // The pixel is in a region too small to be trusted.
  MRFGS_FLAG_SPECKLE = 4,
  // The confidence is low; the disparity stays.
  MRFGS_FLAG_LOW_CONFIDENCE = 8,
  // The disparity is filled in from other pixels.
  MRFGS_FLAG_FILLED = 16,
  // The pixel is ignored, and has no disparity.
  MRFGS_FLAG_MASKED = 32,
  // Two labels match equally well.
  MRFGS_FLAG_TIE = 64,
  // The pixels around it outvote the disparity, and it is filled in from them.
  MRFGS_FLAG_OUTVOTED = 128,
};
#ifndef __cplusplus
typedef uint8_t mrfgs_flag;
#endif // __cplusplus

// Matches pair after pair, and keeps the device, its compiled shaders and its buffers in between.
typedef struct mrfgs_matcher mrfgs_matcher;

// What a matcher is to do, and where.
typedef struct mrfgs_options mrfgs_options;

// An image in memory.
typedef struct mrfgs_image {
  // The first pixel of the first row.
  const void *data;
  // Bytes from a row to the next one; any number that a row fits into.
  size_t stride;
  // Pixels of a row.
  uint32_t width;
  // Rows.
  uint32_t height;
  // An mrfgs_format.
  uint32_t format;
} mrfgs_image;

// The disparities to search, in pixels, both ends included.
typedef struct mrfgs_range {
  int32_t min;
  int32_t max;
} mrfgs_range;

// Where maps are written; all of them have the size of the images. Null leaves a map out. Strides are in bytes, from a row to the next
// one.
typedef struct mrfgs_maps {
  // sizeof(mrfgs_maps).
  size_t size;
  // The disparity in pixels, +infinity where there is none. Left (x, y) with disparity d is seen at right (x - d, y).
  float *disparity;
  size_t disparity_stride;
  // How far the best runner-up is behind, in 1/8 nat; 0 where nothing was measured.
  uint8_t *confidence;
  size_t confidence_stride;
  // Why each pixel is what it is: the sum of mrfgs_flag.
  uint8_t *validity;
  size_t validity_stride;
} mrfgs_maps;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of the library, such as "0.1.0".
const char *mrfgs_version(void);

// Opens the device, and makes *matcher; options may be null, and are not needed afterwards. Where it fails, *matcher is null.
enum mrfgs_status mrfgs_matcher_new(const struct mrfgs_options *options,
                                    struct mrfgs_matcher **matcher);

// Frees a matcher, when no match of it runs any more; it may be null.
void mrfgs_matcher_free(struct mrfgs_matcher *matcher);

// Ends the match that runs, from another thread, or else the next one: it returns MRFGS_STATUS_STOPPED.
enum mrfgs_status mrfgs_matcher_stop(const struct mrfgs_matcher *matcher);

// Matches a rectified pair of images of one size, and writes maps. Without a range (null), sparse matches find it.
enum mrfgs_status mrfgs_match(const struct mrfgs_matcher *matcher,
                              const struct mrfgs_image *left,
                              const struct mrfgs_image *right,
                              const struct mrfgs_range *range,
                              const struct mrfgs_maps *maps);

// What ran the last match of this thread that succeeded, for people; "" before the first. It stays until the next one.
const char *mrfgs_last_device(void);

// Why that is not the device that was hoped for; "" where it is.
const char *mrfgs_last_note(void);

// The preset "default", on a GPU where there is one and else on the CPU, with a thread for each core.
struct mrfgs_options *mrfgs_options_new(void);

// Frees options; they may be null.
void mrfgs_options_free(struct mrfgs_options *options);

// The name of the preset with this index, from 0 on; null past the last one. It stays as it is.
const char *mrfgs_preset_name(uint32_t index);

// Takes all options of the preset with this name; mrfgs_preset_name() lists them.
enum mrfgs_status mrfgs_options_preset(struct mrfgs_options *options, const char *name);

// Sets an option: "fill" or "refinement.fill" to "none", "memory" (in MiB) to "2048". `mrfgs presets` lists all, with their values.
enum mrfgs_status mrfgs_options_set(struct mrfgs_options *options,
                                    const char *key,
                                    const char *value);

// Sets every option that a TOML file holds, as `mrfgs match --method FILE` does.
enum mrfgs_status mrfgs_options_load(struct mrfgs_options *options, const char *path);

// What runs a match: "auto" takes a GPU where there is one, else the CPU; "cpu"; "gpu" fails where there is none; anything else is the
// index of a device, such as "0", or a part of its name, as `mrfgs devices` lists them. The maps are the same, bit for bit.
enum mrfgs_status mrfgs_options_device(struct mrfgs_options *options,
                                       const char *name);

// The threads of a match on the CPU, up to 1024; 0 takes one for each core.
enum mrfgs_status mrfgs_options_threads(struct mrfgs_options *options, uint32_t threads);

// What was wrong with the last call of this thread that failed; "" where none has. It stays until the next call of this thread that
// fails.
const char *mrfgs_last_error(void);

// Looks for what is probably wrong with a pair (views swapped, turned or not rectified, one of them far darker), and for a range that
// cuts off a part of the scene; without a range (null) only for the former. mrfgs_last_warnings() says what it has found. It takes a
// part of the time of a match.
enum mrfgs_status mrfgs_check(const struct mrfgs_image *left,
                              const struct mrfgs_image *right,
                              const struct mrfgs_range *range);

// What the last mrfgs_check() of this thread has found to be probably wrong, or the last mrfgs_match(), which sees whether many
// disparities are at an end of the range; a line for each, "" where all seems well. It stays until the next one that succeeds.
const char *mrfgs_last_warnings(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* MRFGS_H */
