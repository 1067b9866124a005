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
 * mrfgs_maps and mrfgs_view, which say their size; nothing is added to the other structures. */

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

// How the pixels of an image are stored. Samples of more than 8 bits are in the byte order of the machine. Those of 16 bits fill their
// range with the largest value of both images; floats run from the least to the largest value of both, and those that are not finite
// are ignored. A pixel whose alpha is 0 is ignored.
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
  // Grey, float of 32 bits.
  MRFGS_FORMAT_GREY32F = 7,
  // Blue, green and red, 8 bits each, as OpenCV has them.
  MRFGS_FORMAT_BGR8 = 8,
  // Blue, green and red, 16 bits each.
  MRFGS_FORMAT_BGR16 = 9,
  // Blue, green, red and alpha, 8 bits each.
  MRFGS_FORMAT_BGRA8 = 10,
  // Blue, green, red and alpha, 16 bits each.
  MRFGS_FORMAT_BGRA16 = 11,
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

// What is known of a pair of cameras.
typedef struct mrfgs_calibration mrfgs_calibration;

// What the frames of a rig show of how its right camera has turned since it was calibrated.
typedef struct mrfgs_drift mrfgs_drift;

// Matches pair after pair, and keeps the device, its compiled shaders and its buffers in between.
typedef struct mrfgs_matcher mrfgs_matcher;

// What a matcher is to do, and where.
typedef struct mrfgs_options mrfgs_options;

// How images as the cameras took them become a rectified pair. It is found once, and applied to any number of pairs.
typedef struct mrfgs_rectification mrfgs_rectification;

// The cameras of a rectified pair: from disparities to depths.
typedef struct mrfgs_rig mrfgs_rig;

// A filter for the maps of a sequence: where the left image does not change, the disparity follows that of the frames before.
typedef struct mrfgs_steady mrfgs_steady;

// A camera beside the pair, such as the colour camera of a rig: its lens, its size, and how it stands to the left camera.
typedef struct mrfgs_third_camera mrfgs_third_camera;

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

// How the right camera of a rig has turned.
typedef struct mrfgs_turn {
  // How far it looks up, to the right and clockwise, in degrees, from where it was calibrated.
  double degrees[3];
  // The standard errors of these, in degrees, as if all frames showed one still scene.
  double errors[3];
  // How far that moves rows apart at most, in pixels.
  double rows;
  // How many matches show it: 0 where the frames have too few, and all the rest is 0 then.
  uint32_t matches;
  // 1 where it moves rows by 0.1 px or more and is no chance, else 0.
  uint32_t counts;
} mrfgs_turn;

// Where maps are written; all of them have the size of the images. Null leaves a map out. Strides are in bytes, from a row to the next
// one.
typedef struct mrfgs_maps {
  // sizeof(mrfgs_maps).
  size_t size;
  // The disparity in pixels, +infinity where there is none. Left (x, y) with disparity d is seen at right (x - d, y).
  float *disparity;
  size_t disparity_stride;
  // How far the best runner-up is behind, in 1/8 nat, as a mean over the pixels around; those with another disparity count 0. It
  // is 0 where nothing was measured.
  uint8_t *confidence;
  size_t confidence_stride;
  // Why each pixel is what it is: the sum of mrfgs_flag.
  uint8_t *validity;
  size_t validity_stride;
  // The disparity of the right view in pixels, +infinity where there is none: right (x, y) with disparity d is seen at left (x + d, y).
  // A match that writes it takes longer.
  float *right;
  size_t right_stride;
  // The error to expect of every measured disparity in pixels, from its confidence: about two thirds are nearer to the truth.
  // +infinity where nothing was measured.
  float *sigma;
  size_t sigma_stride;
} mrfgs_maps;

// A part of the left image, in pixels: its first column and row, and its size.
typedef struct mrfgs_region {
  uint32_t x;
  uint32_t y;
  uint32_t width;
  uint32_t height;
} mrfgs_region;

// Where a rectified view is written; it has the size of mrfgs_rectification_size(). Strides are in bytes, from a row to the next one.
typedef struct mrfgs_view {
  // sizeof(mrfgs_view).
  size_t size;
  // The pixels; 0 where there is no source. Null leaves them out.
  void *data;
  size_t stride;
  // The mrfgs_format of the pixels, of 8 or 16 bits. Of views of more than 8 bits, 8 bits are the upper ones; alpha is 0 where there is
  // no source.
  uint32_t format;
  // 255 where there is no source, else 0: a mask for mrfgs_match_masked(). Null leaves it out.
  uint8_t *mask;
  size_t mask_stride;
} mrfgs_view;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of the library, such as "0.1.0".
const char *mrfgs_version(void);

// Reads a calibration from one file, or from several that belong together (ROS has one for each camera), in any form that `mrfgs match`
// takes: the content tells it.
enum mrfgs_status mrfgs_calibration_read(const char *const *paths,
                                         size_t count,
                                         struct mrfgs_calibration **calibration);

// The same of the texts of such files. Errors call them "texts[0]" and so on.
enum mrfgs_status mrfgs_calibration_of_texts(const char *const *texts,
                                             size_t count,
                                             struct mrfgs_calibration **calibration);

// States the unit of the baseline, where the files do not or wrongly: "mm", "cm" or "m".
enum mrfgs_status mrfgs_calibration_unit(struct mrfgs_calibration *calibration, const char *unit);

// Makes it that of a part of the images, for images that show that part alone, as it is or scaled. Both cameras have the same part.
enum mrfgs_status mrfgs_calibration_crop(struct mrfgs_calibration *calibration, const struct mrfgs_region *part);

// Frees a calibration; it may be null.
void mrfgs_calibration_free(struct mrfgs_calibration *calibration);

// The drift of a rig with this rectification, from which nothing has turned yet. The rectification may be freed before it.
enum mrfgs_status mrfgs_drift_new(const struct mrfgs_rectification *rectification,
                                  struct mrfgs_drift **drift);

// Takes the next frame, rectified by what mrfgs_drift_correct() gave last, and before that by the rectification of the calibration. It
// looks at the first, the fourth, the sixteenth, and then at every 64th, and of these the last 16 count. The masks are those of the views,
// as mrfgs_match_masked() takes them; each may be null. The range holds the disparities of the frame. Calls for one drift take turns.
enum mrfgs_status mrfgs_drift_follow(const struct mrfgs_drift *drift,
                                     const struct mrfgs_image *left,
                                     const struct mrfgs_image *right,
                                     const struct mrfgs_image *left_mask,
                                     const struct mrfgs_image *right_mask,
                                     const struct mrfgs_range *range);

// How the right camera has turned since the calibration, as far as the last frames show it.
enum mrfgs_status mrfgs_drift_turn(const struct mrfgs_drift *drift, struct mrfgs_turn *turn);

// Makes the rectification of the next frames: that of the calibration, with the right camera turned. It is null where what rectified the
// last ones is still right. Free both, the one before when nothing uses it any more.
enum mrfgs_status mrfgs_drift_correct(const struct mrfgs_drift *drift,
                                      struct mrfgs_rectification **rectification);

// Frees a drift; it may be null.
void mrfgs_drift_free(struct mrfgs_drift *drift);

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

// The same with masks, MRFGS_FORMAT_GREY8 and of the size of the images: where one is not 0, the pixel of its image is ignored. Each
// may be null.
enum mrfgs_status mrfgs_match_masked(const struct mrfgs_matcher *matcher,
                                     const struct mrfgs_image *left,
                                     const struct mrfgs_image *right,
                                     const struct mrfgs_image *left_mask,
                                     const struct mrfgs_image *right_mask,
                                     const struct mrfgs_range *range,
                                     const struct mrfgs_maps *maps);

// The same of a region of the left image alone, in the time of that part; null takes all. The maps have the size of the region.
enum mrfgs_status mrfgs_match_region(const struct mrfgs_matcher *matcher,
                                     const struct mrfgs_image *left,
                                     const struct mrfgs_image *right,
                                     const struct mrfgs_image *left_mask,
                                     const struct mrfgs_image *right_mask,
                                     const struct mrfgs_range *range,
                                     const struct mrfgs_region *region,
                                     const struct mrfgs_maps *maps);

// What ran the last match of this thread that succeeded, for people; "" before the first. It stays until the next one.
const char *mrfgs_last_device(void);

// Why that is not the device that was hoped for; "" where it is.
const char *mrfgs_last_note(void);

// The preset "default", on a GPU where there is one and else on the CPU, with the usual number of threads.
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

// The threads of a match on the CPU at most, up to 1024; 0 takes as many as processors that the process may use, by affinity and cgroups, or
// fewer where RAYON_NUM_THREADS, OMP_NUM_THREADS, SLURM_CPUS_PER_TASK or SLURM_CPUS_ON_NODE is a smaller number.
enum mrfgs_status mrfgs_options_threads(struct mrfgs_options *options, uint32_t threads);

// The rectification of images of so many pixels (0 and 0: those of the calibration), as OpenCV's stereoRectify chooses it. Alpha is from
// 0, where every pixel of the views has a source, to 1, where no pixel of the images is lost; below 0 it is the rectification of the
// calibration where it has one, else one that keeps the focal length. zero_disparity is 1 where what is infinitely far is to have a
// disparity of 0, else 0. mrfgs_last_warnings() says what is probably wrong with the calibration.
enum mrfgs_status mrfgs_rectification_new(const struct mrfgs_calibration *calibration,
                                          uint32_t width,
                                          uint32_t height,
                                          double alpha,
                                          uint32_t zero_disparity,
                                          struct mrfgs_rectification **rectification);

// Width and height of the rectified views, in pixels; turned by a quarter where one camera is above the other.
enum mrfgs_status mrfgs_rectification_size(const struct mrfgs_rectification *rectification,
                                           uint32_t *width,
                                           uint32_t *height);

// Rectifies a pair of images, and writes both views.
enum mrfgs_status mrfgs_rectify(const struct mrfgs_rectification *rectification,
                                const struct mrfgs_image *left,
                                const struct mrfgs_image *right,
                                const struct mrfgs_view *left_view,
                                const struct mrfgs_view *right_view);

// Frees a rectification; it may be null.
void mrfgs_rectification_free(struct mrfgs_rectification *rectification);

// The rig of a pair that is rectified already, by its focal length and doffs (cx of the right camera less cx of the left one; mostly 0) in
// pixels, and by its baseline, whose unit is that of all depths.
enum mrfgs_status mrfgs_rig_new(double focal,
                                double baseline,
                                double doffs,
                                struct mrfgs_rig **rig);

// The rig of a pair that is rectified already, by its calibration. One that is for images of several sizes is refused: give
// mrfgs_rig_new() the numbers of yours.
enum mrfgs_status mrfgs_rig_of_calibration(const struct mrfgs_calibration *calibration,
                                           struct mrfgs_rig **rig);

// The rig of what a rectification makes.
enum mrfgs_status mrfgs_rig_of_rectification(const struct mrfgs_rectification *rectification, struct mrfgs_rig **rig);

// The unit of the baseline, and so of depths: "mm", "cm", "m", or "unknown"; null for a rig that is null. It stays as it is.
const char *mrfgs_rig_unit(const struct mrfgs_rig *rig);

// The depth of every pixel along the optical axis, in the unit of the baseline, of a map of disparities in pixels: +infinity where there
// is none. Strides are in bytes. Both maps may be one.
enum mrfgs_status mrfgs_depth(const struct mrfgs_rig *rig,
                              uint32_t width,
                              uint32_t height,
                              const float *disparity,
                              size_t disparity_stride,
                              float *depth,
                              size_t depth_stride);

// The error to expect of every depth, in the unit of the baseline, of maps of disparities and of their errors (mrfgs_maps.sigma), both
// in pixels: +infinity where there is none. Strides are in bytes. The maps may be one.
enum mrfgs_status mrfgs_depth_sigma(const struct mrfgs_rig *rig,
                                    uint32_t width,
                                    uint32_t height,
                                    const float *disparity,
                                    size_t disparity_stride,
                                    const float *sigma,
                                    size_t sigma_stride,
                                    float *depth_sigma,
                                    size_t depth_sigma_stride);

// Frees a rig; it may be null.
void mrfgs_rig_free(struct mrfgs_rig *rig);

// What was wrong with the last call of this thread that failed; "" where none has. It stays until the next call of this thread that
// fails.
const char *mrfgs_last_error(void);

// A filter that has seen no frame yet.
enum mrfgs_status mrfgs_steady_new(struct mrfgs_steady **steady);

// Lets the disparities of the next frame follow those of the frames before, weighted by confidence, where the left image has not changed.
// `left` is the image that was matched, and `maps` are what the match has written: disparity, confidence and validity, of which the
// disparity is changed and the others are read. A frame of another size begins a new sequence. Calls for one filter take turns.
// For images of 8 bits these are the maps of `mrfgs sequence --steady`; deeper ones are scaled by their own values, where the program
// looks at both views.
enum mrfgs_status mrfgs_steady_follow(const struct mrfgs_steady *steady,
                                      const struct mrfgs_image *left,
                                      const struct mrfgs_maps *maps);

// Frees a filter; it may be null.
void mrfgs_steady_free(struct mrfgs_steady *steady);

// Reads it from a file, in any form that `mrfgs match --into` takes: one camera by the names of OpenCV or ROS, the last camera of
// Kalibr's chain, or that of an OAK's calibration which is not one of its pair.
enum mrfgs_status mrfgs_third_camera_read(const char *path,
                                          struct mrfgs_third_camera **camera);

// The same of the text of such a file. Errors call it "text".
enum mrfgs_status mrfgs_third_camera_of_text(const char *text, struct mrfgs_third_camera **camera);

// Width and height of its images, in pixels.
enum mrfgs_status mrfgs_third_camera_size(const struct mrfgs_third_camera *camera, uint32_t *width, uint32_t *height);

// The depths as a third camera sees them, along its axis and at its pixels, in the unit of the baseline: +infinity where it sees what the
// map does not. `width` and `height` are those of the map of disparities (in pixels), and the map of depths has the size of
// mrfgs_third_camera_size(). The nearest of several surfaces counts, and each pixel of the map covers what it covers there. Strides are in
// bytes; the maps are not one.
//
// The camera stands to the left camera that took the images where the rig is one of mrfgs_rig_of_rectification(), else to the rectified
// one. A rig of mrfgs_rig_new() is refused, as it knows no principal point.
enum mrfgs_status mrfgs_depth_registered(const struct mrfgs_rig *rig,
                                         uint32_t width,
                                         uint32_t height,
                                         const float *disparity,
                                         size_t disparity_stride,
                                         const struct mrfgs_third_camera *camera,
                                         float *depth,
                                         size_t depth_stride);

// Frees a third camera; it may be null.
void mrfgs_third_camera_free(struct mrfgs_third_camera *camera);

// Looks for what is probably wrong with a pair (views swapped, turned or not rectified, one of them far darker), and for a range that
// cuts off a part of the scene; without a range (null) only for the former. mrfgs_last_warnings() says what it has found. It takes a
// part of the time of a match.
enum mrfgs_status mrfgs_check(const struct mrfgs_image *left,
                              const struct mrfgs_image *right,
                              const struct mrfgs_range *range);

// The same with masks, as mrfgs_match_masked() takes them.
enum mrfgs_status mrfgs_check_masked(const struct mrfgs_image *left,
                                     const struct mrfgs_image *right,
                                     const struct mrfgs_image *left_mask,
                                     const struct mrfgs_image *right_mask,
                                     const struct mrfgs_range *range);

// What the last mrfgs_check() of this thread has found to be probably wrong, or the last mrfgs_match(), which sees whether many
// disparities are at an end of the range, or the last mrfgs_rectification_new() or mrfgs_rig_of_calibration(), which see whether the
// calibration is of other images or in another unit; a line for each, "" where all seems well. It stays until the next one that succeeds.
const char *mrfgs_last_warnings(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* MRFGS_H */
