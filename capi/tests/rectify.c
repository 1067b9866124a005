/* Rectifies raw frames, matches them and computes depths, and compares all with the program's output byte by byte.
 *
 *     rectify-c CAMERAS.yml RECTIFIED.yml LEFT.ppm RIGHT.ppm VIEW0.ppm VIEW1.ppm MASK0.pgm MASK1.pgm MAX-DISPARITY MAP.pfm RIGHT-MAP.pfm \
 *         DEPTH.pfm DEPTH-SIGMA.pfm THIRD.yml DEPTH-REGISTERED.pfm WRONG.yml CORRECTED.pfm
 *
 * Then tests the errors that a caller can cause. */
#include "pnm.h"

#include <mrfgs.h>

#define CHECK(condition) check((condition) != 0, #condition, __LINE__)

static void check(int holds, const char *condition, int line) {
    if (!holds) {
        fprintf(stderr, "rectify.c:%d: %s; the last error: %s\n", line, condition, mrfgs_last_error());
        exit(1);
    }
}

/* Checks that the call fails with this status, and that its message contains both words. */
static void refused(mrfgs_status expected, mrfgs_status status, const char *word, const char *other) {
    if (status != expected || !strstr(mrfgs_last_error(), word) || !strstr(mrfgs_last_error(), other)) {
        fprintf(stderr, "rectify.c: status %d and not %d, without `%s` or `%s`: %s\n", (int)status, (int)expected, word, other,
                mrfgs_last_error());
        exit(1);
    }
}

static char *text_of(const char *path) {
    FILE *file = fopen(path, "rb");
    char *text = calloc(1 << 16, 1);
    CHECK(file && fread(text, 1, (1 << 16) - 1, file) > 0);
    fclose(file);
    return text;
}

static mrfgs_image image_of(const struct pnm *pnm, mrfgs_format format) {
    mrfgs_image image = {pnm->data, pnm->width * pnm->channels, (uint32_t)pnm->width, (uint32_t)pnm->height, format};
    return image;
}

/* Both views in `format`, with 5 bytes of padding after each row. */
struct views {
    size_t stride, mask_stride;
    uint8_t *data[2], *masks[2];
};

static struct views rectified(const mrfgs_rectification *by, const mrfgs_image images[2], size_t pixel, mrfgs_format format) {
    uint32_t width, height;
    CHECK(mrfgs_rectification_size(by, &width, &height) == MRFGS_STATUS_OK);
    struct views views = {width * pixel + 5, width + 3, {NULL, NULL}, {NULL, NULL}};
    mrfgs_view places[2];
    for (int i = 0; i < 2; i++) {
        views.data[i] = malloc(views.stride * height);
        views.masks[i] = malloc(views.mask_stride * height);
        memset(views.data[i], 0x5a, views.stride * height);
        memset(views.masks[i], 0x5a, views.mask_stride * height);
        mrfgs_view place = {sizeof place, views.data[i], views.stride, format, views.masks[i], views.mask_stride};
        places[i] = place;
    }
    CHECK(mrfgs_rectify(by, &images[0], &images[1], &places[0], &places[1]) == MRFGS_STATUS_OK);
    return views;
}

static void free_views(struct views *views) {
    for (int i = 0; i < 2; i++) free(views->data[i]), free(views->masks[i]);
}

/* Whether the rows equal `expected`, and the padding is untouched. */
static int same(const uint8_t *rows, size_t stride, const struct pnm *expected) {
    size_t row = expected->width * expected->channels * expected->bytes;
    for (size_t y = 0; y < expected->height; y++) {
        if (memcmp(rows + y * stride, expected->data + y * row, row) != 0) return 0;
        for (size_t x = row; x < stride; x++)
            if (rows[y * stride + x] != 0x5a) return 0;
    }
    return 1;
}

static void views_are_the_programs(const mrfgs_rectification *by, const struct pnm raw[2], const struct pnm expected[2],
                                   const struct pnm masks[2]) {
    mrfgs_image rgb[2] = {image_of(&raw[0], MRFGS_FORMAT_RGB8), image_of(&raw[1], MRFGS_FORMAT_RGB8)};
    struct views views = rectified(by, rgb, 3, MRFGS_FORMAT_RGB8);
    for (int i = 0; i < 2; i++) {
        CHECK(same(views.data[i], views.stride, &expected[i]) && same(views.masks[i], views.mask_stride, &masks[i]));
        /* Control: the views are not swapped. */
        CHECK(!same(views.data[i], views.stride, &expected[1 - i]));
    }
    /* Other formats, in and out: BGR, with alpha, and with 16 bits. */
    mrfgs_image bgr[2] = {image_of(&raw[0], MRFGS_FORMAT_BGR8), image_of(&raw[1], MRFGS_FORMAT_BGR8)};
    struct views others = rectified(by, bgr, 3, MRFGS_FORMAT_BGR8), alpha = rectified(by, rgb, 4, MRFGS_FORMAT_BGRA8),
                 words = rectified(by, rgb, 6, MRFGS_FORMAT_RGB16), grey = rectified(by, rgb, 1, MRFGS_FORMAT_GREY8);
    for (int i = 0; i < 2; i++) {
        CHECK(same(others.data[i], others.stride, &expected[i]));
        for (size_t y = 0; y < masks[i].height; y++)
            for (size_t x = 0; x < masks[i].width; x++) {
                const uint8_t *pixel = views.data[i] + y * views.stride + 3 * x, *bgra = alpha.data[i] + y * alpha.stride + 4 * x;
                uint8_t masked = masks[i].data[y * masks[i].width + x], shade = grey.data[i][y * grey.stride + x];
                uint16_t word[3];
                memcpy(word, words.data[i] + y * words.stride + 6 * x, sizeof word);
                for (int c = 0; c < 3; c++) CHECK(bgra[2 - c] == pixel[c] && word[c] >> 8 == pixel[c]);
                CHECK(bgra[3] == 255 - masked && (masked == 0 || masked == 255));
                double expected_shade = 0.299 * pixel[0] + 0.587 * pixel[1] + 0.114 * pixel[2];
                CHECK(shade >= expected_shade - 1 && shade <= expected_shade + 1);
            }
    }
    free_views(&views);
    free_views(&others);
    free_views(&alpha);
    free_views(&words);
    free_views(&grey);
}

/* The map of both views, and depths. */
static void maps_are_the_programs(const mrfgs_rectification *by, const char *calibration_path, const struct pnm raw[2],
                                  mrfgs_range range, const struct pnm expected[4]) {
    mrfgs_image images[2] = {image_of(&raw[0], MRFGS_FORMAT_RGB8), image_of(&raw[1], MRFGS_FORMAT_RGB8)};
    struct views views = rectified(by, images, 3, MRFGS_FORMAT_RGB8);
    uint32_t width = (uint32_t)expected[0].width, height = (uint32_t)expected[0].height;
    size_t pixels = (size_t)width * height, bytes = pixels * sizeof(float), stride = width * sizeof(float);
    mrfgs_image left = {views.data[0], views.stride, width, height, MRFGS_FORMAT_RGB8}, right = left;
    mrfgs_image masks[2] = {{views.masks[0], views.mask_stride, width, height, MRFGS_FORMAT_GREY8},
                            {views.masks[1], views.mask_stride, width, height, MRFGS_FORMAT_GREY8}};
    right.data = views.data[1];
    mrfgs_options *options = mrfgs_options_new();
    mrfgs_matcher *matcher;
    CHECK(mrfgs_options_preset(options, "fast") == MRFGS_STATUS_OK && mrfgs_options_device(options, "cpu") == MRFGS_STATUS_OK);
    CHECK(mrfgs_matcher_new(options, &matcher) == MRFGS_STATUS_OK);
    float *map = malloc(bytes), *of_right = malloc(bytes), *depth = malloc(bytes), *other = malloc(bytes),
          *sigma = malloc(bytes);
    mrfgs_maps maps = {.size = sizeof maps, .disparity = map, .disparity_stride = stride, .right = of_right, .right_stride = stride,
                       .sigma = sigma, .sigma_stride = stride};
    CHECK(mrfgs_match_masked(matcher, &left, &right, &masks[0], &masks[1], &range, &maps) == MRFGS_STATUS_OK);
    CHECK(memcmp(map, expected[0].data, bytes) == 0 && memcmp(of_right, expected[1].data, bytes) == 0);
    /* Control: without masks, the borders find matches. */
    maps.disparity = other, maps.sigma = NULL;
    CHECK(mrfgs_match(matcher, &left, &right, &range, &maps) == MRFGS_STATUS_OK && memcmp(other, map, bytes) != 0);

    mrfgs_rig *rig;
    CHECK(mrfgs_rig_of_rectification(by, &rig) == MRFGS_STATUS_OK && strcmp(mrfgs_rig_unit(rig), "m") == 0);
    CHECK(mrfgs_depth(rig, width, height, map, stride, depth, stride) == MRFGS_STATUS_OK);
    CHECK(memcmp(depth, expected[2].data, bytes) == 0);
    /* Control: another map gives other depths. In place. */
    memcpy(other, of_right, bytes);
    CHECK(mrfgs_depth(rig, width, height, other, stride, other, stride) == MRFGS_STATUS_OK && memcmp(other, depth, bytes) != 0);
    /* The errors of depths. Control: twice the error of disparities gives larger errors of depths. */
    CHECK(mrfgs_depth_sigma(rig, width, height, map, stride, sigma, stride, other, stride) == MRFGS_STATUS_OK);
    CHECK(memcmp(other, expected[3].data, bytes) == 0);
    for (size_t i = 0; i < pixels; i++) sigma[i] *= 2;
    CHECK(mrfgs_depth_sigma(rig, width, height, map, stride, sigma, stride, sigma, stride) == MRFGS_STATUS_OK);
    for (size_t i = 0; i < pixels; i++) CHECK(sigma[i] == 2 * other[i]);
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_depth_sigma(rig, width, height, map, stride, NULL, stride, other, stride), "map of sigma", "null");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_depth(rig, width - 1, height, map, stride, depth, stride), "239 x 180", "240 x 180");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_depth(rig, width, height, map, 7, depth, stride), "map of disparity", "stride of 7");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_depth(rig, width, height, map, stride, NULL, stride), "map of depth", "null");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_depth(NULL, width, height, map, stride, depth, stride), "rig", "null");
    mrfgs_rig_free(rig);

    /* The calibration of the rectified pair, whose numbers are rounded. */
    mrfgs_calibration *calibration;
    CHECK(mrfgs_calibration_read(&calibration_path, 1, &calibration) == MRFGS_STATUS_OK);
    CHECK(mrfgs_rig_of_calibration(calibration, &rig) == MRFGS_STATUS_OK);
    CHECK(mrfgs_depth(rig, width, height, map, stride, other, stride) == MRFGS_STATUS_OK);
    for (size_t i = 0; i < pixels; i++) CHECK(other[i] == depth[i] || (other[i] / depth[i] < 1.00001f && other[i] / depth[i] > 0.99999f));
    mrfgs_rig_free(rig);
    mrfgs_calibration_free(calibration);

    /* Numbers. */
    const float ramp[4] = {4.5f, 60, -1, -2};
    float found[4];
    CHECK(mrfgs_rig_new(700.5, 0.12, 1, &rig) == MRFGS_STATUS_OK && strcmp(mrfgs_rig_unit(rig), "unknown") == 0);
    CHECK(mrfgs_depth(rig, 4, 1, ramp, sizeof ramp, found, sizeof found) == MRFGS_STATUS_OK);
    CHECK(found[0] == (float)(0.12 * 700.5 / 5.5) && found[1] == (float)(0.12 * 700.5 / 61) && found[2] > 1e30f && found[3] > 1e30f);
    mrfgs_rig_free(rig);
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_rig_new(0, 0.12, 0, &rig), "focal is 0", "above 0");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_rig_new(700, -1, 0, &rig), "baseline is -1", "above 0");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_rig_new(700, 1, 1.0 / 0.0, &rig), "doffs is inf", "give a number");
    CHECK(rig == NULL && mrfgs_rig_unit(NULL) == NULL);
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_rig_new(700, 1, 0, NULL), "place", "rig");
    mrfgs_rig_free(NULL);
    mrfgs_matcher_free(matcher);
    mrfgs_options_free(options);
    free_views(&views);
    free(map), free(of_right), free(depth), free(other), free(sigma);
}

/* Depths registered to a third camera. */
static void third_camera_is_the_programs(const mrfgs_rectification *by, const char *rectified_path, const char *third_path,
                                         const struct pnm *map, const struct pnm *expected) {
    const mrfgs_status wrong = MRFGS_STATUS_ARGUMENT;
    uint32_t width = (uint32_t)map->width, height = (uint32_t)map->height, wide = 0, high = 0;
    const float *disparity = (const float *)(const void *)map->data;
    size_t stride = width * sizeof(float), bytes = expected->width * expected->height * sizeof(float);
    mrfgs_third_camera *camera, *again, *none;
    mrfgs_rig *rig, *other_rig;
    CHECK(mrfgs_third_camera_read(third_path, &camera) == MRFGS_STATUS_OK);
    CHECK(mrfgs_third_camera_size(camera, &wide, &high) == MRFGS_STATUS_OK && wide == expected->width && high == expected->height);
    CHECK(mrfgs_rig_of_rectification(by, &rig) == MRFGS_STATUS_OK);
    /* 5 bytes of padding after each row remain untouched. */
    size_t out_stride = wide * sizeof(float) + 5;
    uint8_t *depth = malloc(out_stride * high), *other = malloc(bytes);
    memset(depth, 0x5a, out_stride * high);
    CHECK(mrfgs_depth_registered(rig, width, height, disparity, stride, camera, (float *)(void *)depth, out_stride) == MRFGS_STATUS_OK);
    CHECK(same(depth, out_stride, expected));
    char *text = text_of(third_path);
    CHECK(mrfgs_third_camera_of_text(text, &again) == MRFGS_STATUS_OK);
    size_t row = wide * sizeof(float);
    float *out = (float *)(void *)other;
    CHECK(mrfgs_depth_registered(rig, width, height, disparity, stride, again, out, row) == MRFGS_STATUS_OK);
    CHECK(memcmp(other, expected->data, bytes) == 0);
    /* Control: without the rotation of the rectification, the pose of the camera is wrong. */
    mrfgs_calibration *calibration;
    CHECK(mrfgs_calibration_read(&rectified_path, 1, &calibration) == MRFGS_STATUS_OK);
    CHECK(mrfgs_rig_of_calibration(calibration, &other_rig) == MRFGS_STATUS_OK);
    CHECK(mrfgs_depth_registered(other_rig, width, height, disparity, stride, camera, out, row) == MRFGS_STATUS_OK);
    CHECK(memcmp(other, expected->data, bytes) != 0);
    mrfgs_rig_free(other_rig);
    mrfgs_calibration_free(calibration);

    CHECK(mrfgs_rig_new(260, 0.1, 0, &other_rig) == MRFGS_STATUS_OK);
    refused(wrong, mrfgs_depth_registered(other_rig, width, height, disparity, stride, camera, out, row), "principal point", "mrfgs_rig_of");
    refused(wrong, mrfgs_depth_registered(NULL, width, height, disparity, stride, camera, out, row), "rig", "null");
    refused(wrong, mrfgs_depth_registered(rig, width, height, disparity, stride, NULL, out, row), "camera", "null");
    refused(wrong, mrfgs_depth_registered(rig, width, height, NULL, stride, camera, out, row), "map of disparity", "null");
    refused(wrong, mrfgs_depth_registered(rig, width, height, disparity, stride, camera, NULL, row), "map of depth", "null");
    refused(wrong, mrfgs_depth_registered(rig, width, height, disparity, stride, camera, out, row - 1), "map of depth", "stride of 1599");
    refused(wrong, mrfgs_depth_registered(rig, width, height - 1, disparity, stride, camera, out, row), "240 x 179", "240 x 180");
    refused(MRFGS_STATUS_FILE, mrfgs_third_camera_read("/none/such.yml", &none), "/none/such.yml", "cannot read");
    refused(MRFGS_STATUS_FILE, mrfgs_third_camera_of_text("K: [1, 2]", &none), "text", "K");
    CHECK(none == NULL);
    refused(wrong, mrfgs_third_camera_read(NULL, &none), "path", "null");
    refused(wrong, mrfgs_third_camera_of_text(text, NULL), "place", "camera");
    refused(wrong, mrfgs_third_camera_size(NULL, &wide, &high), "camera", "null");
    refused(wrong, mrfgs_third_camera_size(camera, &wide, NULL), "height", "null");
    mrfgs_rig_free(other_rig);
    mrfgs_rig_free(rig);
    mrfgs_third_camera_free(camera);
    mrfgs_third_camera_free(again);
    mrfgs_third_camera_free(NULL);
    free(text), free(depth), free(other);
}

/* The map of raw frames after rectification. */
static void match_rectified(const mrfgs_matcher *matcher, const mrfgs_rectification *by, const mrfgs_image images[2], mrfgs_range range,
                            mrfgs_drift *drift, float *map) {
    uint32_t width, height;
    CHECK(mrfgs_rectification_size(by, &width, &height) == MRFGS_STATUS_OK);
    struct views views = rectified(by, images, 3, MRFGS_FORMAT_RGB8);
    mrfgs_image pair[2], masks[2];
    for (int i = 0; i < 2; i++) {
        mrfgs_image view = {views.data[i], views.stride, width, height, MRFGS_FORMAT_RGB8},
                    mask = {views.masks[i], views.mask_stride, width, height, MRFGS_FORMAT_GREY8};
        pair[i] = view, masks[i] = mask;
    }
    mrfgs_maps maps = {.size = sizeof maps, .disparity = map, .disparity_stride = width * sizeof(float)};
    CHECK(mrfgs_match_masked(matcher, &pair[0], &pair[1], &masks[0], &masks[1], &range, &maps) == MRFGS_STATUS_OK);
    CHECK(mrfgs_drift_follow(drift, &pair[0], &pair[1], &masks[0], &masks[1], &range) == MRFGS_STATUS_OK);
    free_views(&views);
}

/* The second of two frames from a rig with a wrong calibration. */
static void drift_is_the_programs(const char *wrong_path, const struct pnm raw[2], mrfgs_range range, const struct pnm *expected) {
    const mrfgs_status wrong = MRFGS_STATUS_ARGUMENT;
    mrfgs_image images[2] = {image_of(&raw[0], MRFGS_FORMAT_RGB8), image_of(&raw[1], MRFGS_FORMAT_RGB8)};
    size_t bytes = expected->width * expected->height * sizeof(float);
    float *map = malloc(bytes);
    mrfgs_options *options = mrfgs_options_new();
    mrfgs_matcher *matcher;
    CHECK(mrfgs_options_preset(options, "fast") == MRFGS_STATUS_OK && mrfgs_options_device(options, "cpu") == MRFGS_STATUS_OK);
    CHECK(mrfgs_matcher_new(options, &matcher) == MRFGS_STATUS_OK);
    mrfgs_calibration *calibration;
    mrfgs_rectification *by, *better, *none;
    mrfgs_drift *drift, *other;
    mrfgs_turn turn = {{1, 1, 1}, {1, 1, 1}, 1, 1, 1};
    CHECK(mrfgs_calibration_read(&wrong_path, 1, &calibration) == MRFGS_STATUS_OK);
    CHECK(mrfgs_rectification_new(calibration, 0, 0, -1, 1, &by) == MRFGS_STATUS_OK);
    CHECK(mrfgs_drift_new(by, &drift) == MRFGS_STATUS_OK);
    CHECK(mrfgs_drift_turn(drift, &turn) == MRFGS_STATUS_OK && turn.matches == 0 && turn.degrees[0] == 0 && turn.counts == 0);
    CHECK(mrfgs_drift_correct(drift, &better) == MRFGS_STATUS_OK && better == NULL);

    match_rectified(matcher, by, images, range, drift, map);
    /* Control: the first frame is not corrected. */
    CHECK(memcmp(map, expected->data, bytes) != 0);
    /* The principal point is 3 px too high: the camera pitches up by 0.8 degrees. */
    CHECK(mrfgs_drift_turn(drift, &turn) == MRFGS_STATUS_OK && turn.matches > 100 && turn.counts == 1 && turn.rows > 2);
    CHECK(turn.degrees[0] > 0.6 && turn.degrees[0] < 1.0 && turn.errors[0] > 0 && turn.errors[0] < 0.1);
    CHECK(mrfgs_drift_correct(drift, &better) == MRFGS_STATUS_OK && better != NULL);
    CHECK(mrfgs_drift_correct(drift, &none) == MRFGS_STATUS_OK && none == NULL);
    mrfgs_rectification_free(by);
    match_rectified(matcher, better, images, range, drift, map);
    CHECK(memcmp(map, expected->data, bytes) == 0);

    refused(wrong, mrfgs_drift_new(NULL, &other), "rectification", "null");
    refused(wrong, mrfgs_drift_new(better, NULL), "place", "drift");
    refused(wrong, mrfgs_drift_follow(NULL, &images[0], &images[1], NULL, NULL, &range), "drift", "null");
    refused(wrong, mrfgs_drift_follow(drift, &images[0], NULL, NULL, NULL, &range), "right image", "null");
    refused(wrong, mrfgs_drift_follow(drift, &images[0], &images[1], NULL, NULL, NULL), "range", "null");
    images[0].height = images[1].height = 179;
    refused(wrong, mrfgs_drift_follow(drift, &images[0], &images[1], NULL, NULL, &range), "240 x 180", "240 x 179");
    refused(wrong, mrfgs_drift_turn(NULL, &turn), "drift", "null");
    refused(wrong, mrfgs_drift_turn(drift, NULL), "place", "turn");
    refused(wrong, mrfgs_drift_correct(NULL, &none), "drift", "null");
    CHECK(none == NULL);
    refused(wrong, mrfgs_drift_correct(drift, NULL), "place", "rectification");
    mrfgs_rectification_free(better);
    mrfgs_calibration_free(calibration);
    mrfgs_matcher_free(matcher);
    mrfgs_options_free(options);
    mrfgs_drift_free(drift);
    mrfgs_drift_free(NULL);
    free(map);
}

static void mistakes(const char *path, const mrfgs_calibration *calibration, mrfgs_rectification *by, const struct pnm raw[2]) {
    const mrfgs_status wrong = MRFGS_STATUS_ARGUMENT;
    mrfgs_calibration *other;
    const char *nowhere = "/none/such.yml", *nonsense = "nonsense", *none = NULL;
    refused(MRFGS_STATUS_FILE, mrfgs_calibration_read(&nowhere, 1, &other), "/none/such.yml", "cannot read");
    CHECK(other == NULL);
    refused(MRFGS_STATUS_FILE, mrfgs_calibration_of_texts(&nonsense, 1, &other), "texts[0]", "OpenCV");
    refused(wrong, mrfgs_calibration_read(NULL, 1, &other), "paths", "null");
    refused(wrong, mrfgs_calibration_read(&none, 1, &other), "paths[0]", "null");
    refused(wrong, mrfgs_calibration_read(&path, 0, &other), "calibration", "no file");
    refused(wrong, mrfgs_calibration_read(&path, 1, NULL), "place", "calibration");
    CHECK(mrfgs_calibration_read(&path, 1, &other) == MRFGS_STATUS_OK);
    refused(wrong, mrfgs_calibration_unit(other, "feet"), "feet", "mm, cm, m");
    refused(wrong, mrfgs_calibration_unit(NULL, "m"), "calibration", "null");
    mrfgs_rig *rig;
    refused(wrong, mrfgs_rig_of_calibration(other, &rig), "not rectified", "mrfgs_rig_of_rectification");
    refused(wrong, mrfgs_rig_of_calibration(NULL, &rig), "calibration", "null");
    refused(wrong, mrfgs_rig_of_rectification(NULL, &rig), "rectification", "null");
    /* A given unit. */
    mrfgs_rectification *in_cm;
    CHECK(mrfgs_calibration_unit(other, "cm") == MRFGS_STATUS_OK);
    CHECK(mrfgs_rectification_new(other, 0, 0, 0.5, 0, &in_cm) == MRFGS_STATUS_OK);
    CHECK(mrfgs_rig_of_rectification(in_cm, &rig) == MRFGS_STATUS_OK && strcmp(mrfgs_rig_unit(rig), "cm") == 0);
    mrfgs_rig_free(rig);
    mrfgs_rectification_free(in_cm);
    mrfgs_calibration_free(other);
    mrfgs_calibration_free(NULL);
    mrfgs_rectification_free(NULL);

    mrfgs_rectification *new;
    refused(wrong, mrfgs_rectification_new(NULL, 0, 0, -1, 1, &new), "calibration", "null");
    refused(wrong, mrfgs_rectification_new(calibration, 0, 0, 1.5, 1, &new), "alpha is 1.5", "0 to 1");
    refused(wrong, mrfgs_rectification_new(calibration, 0, 0, 0.0 / 0.0, 1, &new), "alpha is NaN", "0 to 1");
    refused(wrong, mrfgs_rectification_new(calibration, 99, 180, -1, 1, &new), "240 x 180", "99 x 180");
    CHECK(new == NULL);
    uint32_t width;
    refused(wrong, mrfgs_rectification_size(by, &width, NULL), "height", "null");
    refused(wrong, mrfgs_rectification_size(NULL, &width, &width), "rectification", "null");

    mrfgs_image image = image_of(&raw[0], MRFGS_FORMAT_RGB8), small = image;
    uint8_t *data = malloc(240 * 180 * 3);
    mrfgs_view view = {sizeof view, data, 240 * 3, MRFGS_FORMAT_RGB8, NULL, 0}, bad = view;
    small.width = 239;
    refused(wrong, mrfgs_rectify(NULL, &image, &image, &view, &view), "rectification", "null");
    refused(wrong, mrfgs_rectify(by, &image, NULL, &view, &view), "right image", "null");
    refused(wrong, mrfgs_rectify(by, &small, &small, &view, &view), "240 x 180", "239 x 180");
    refused(wrong, mrfgs_rectify(by, &image, &image, NULL, &view), "left view", "null");
    bad.size = 8;
    refused(wrong, mrfgs_rectify(by, &image, &image, &bad, &view), "left view", "sizeof(mrfgs_view)");
    bad = view, bad.stride = 719;
    refused(wrong, mrfgs_rectify(by, &image, &image, &view, &bad), "right view", "stride of 719");
    bad = view, bad.format = 99;
    refused(wrong, mrfgs_rectify(by, &image, &image, &view, &bad), "right view", "format 99");
    bad = view, bad.format = MRFGS_FORMAT_GREY32F, bad.stride = 999;
    refused(wrong, mrfgs_rectify(by, &image, &image, &bad, &view), "left view", "8 or 16 bits");
    bad = view, bad.mask = data, bad.mask_stride = 239;
    refused(wrong, mrfgs_rectify(by, &image, &image, &bad, &view), "left view has a mask", "stride of 239");
    /* An unused view. */
    mrfgs_view nothing = {.size = sizeof nothing, .format = MRFGS_FORMAT_GREY8};
    CHECK(mrfgs_rectify(by, &image, &image, &view, &nothing) == MRFGS_STATUS_OK);
    free(data);
}

int main(int argc, char **argv) {
    if (argc != 18) return 2;
    const char *path = argv[1];
    struct pnm files[12];
    const int at[12] = {3, 4, 5, 6, 7, 8, 10, 11, 12, 13, 15, 17};
    for (int i = 0; i < 12; i++) files[i] = pnm_read(argv[at[i]]);
    mrfgs_calibration *calibration, *same_one;
    mrfgs_rectification *by, *again, *wider;
    CHECK(mrfgs_calibration_read(&path, 1, &calibration) == MRFGS_STATUS_OK);
    CHECK(mrfgs_rectification_new(calibration, 0, 0, -1, 1, &by) == MRFGS_STATUS_OK && strlen(mrfgs_last_warnings()) == 0);
    views_are_the_programs(by, &files[0], &files[2], &files[4]);
    char *text = text_of(path);
    CHECK(mrfgs_calibration_of_texts((const char *const *)&text, 1, &same_one) == MRFGS_STATUS_OK);
    CHECK(mrfgs_rectification_new(same_one, 240, 180, -1, 1, &again) == MRFGS_STATUS_OK);
    views_are_the_programs(again, &files[0], &files[2], &files[4]);
    /* Control: another alpha gives other views. */
    CHECK(mrfgs_rectification_new(same_one, 240, 180, 1, 1, &wider) == MRFGS_STATUS_OK);
    mrfgs_image images[2] = {image_of(&files[0], MRFGS_FORMAT_RGB8), image_of(&files[1], MRFGS_FORMAT_RGB8)};
    struct views views = rectified(wider, images, 3, MRFGS_FORMAT_RGB8);
    CHECK(!same(views.data[0], views.stride, &files[2]));
    free_views(&views);
    mrfgs_range range = {0, atoi(argv[9])};
    maps_are_the_programs(by, argv[2], &files[0], range, &files[6]);
    third_camera_is_the_programs(by, argv[2], argv[14], &files[6], &files[10]);
    drift_is_the_programs(argv[16], &files[0], range, &files[11]);
    mistakes(path, calibration, by, &files[0]);
    mrfgs_rectification_free(by);
    mrfgs_rectification_free(again);
    mrfgs_rectification_free(wider);
    mrfgs_calibration_free(calibration);
    mrfgs_calibration_free(same_one);
    free(text);
    for (int i = 0; i < 12; i++) free(files[i].data);
    printf("rectify.c: mrfgs %s: all views, maps and depths are equal\n", mrfgs_version());
    return 0;
}
