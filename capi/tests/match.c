/* Matches frames whose rows lie at odd distances and compares the maps with those of the program: bytes must be equal.
 *
 *     match-c LEFT.pnm RIGHT.pnm MAX-DISPARITY MAP.pfm CONFIDENCE.pgm VALIDITY.pgm
 *
 * Then it makes every mistake that a caller can make. */
#include "pnm.h"

#include <mrfgs.h>

#define CHECK(condition) check((condition) != 0, #condition, __LINE__)

static void check(int holds, const char *condition, int line) {
    if (!holds) {
        fprintf(stderr, "match.c:%d: %s; the last error: %s\n", line, condition, mrfgs_last_error());
        exit(1);
    }
}

/* The call fails like this, and says all these words. */
static void refused(mrfgs_status expected, mrfgs_status status, const char *word, const char *other) {
    if (status != expected || !strstr(mrfgs_last_error(), word) || !strstr(mrfgs_last_error(), other)) {
        fprintf(stderr, "match.c: status %d and not %d, without `%s` or `%s`: %s\n", (int)status, (int)expected, word, other,
                mrfgs_last_error());
        exit(1);
    }
}

/* A frame with `more` bytes behind each row. */
static mrfgs_image spread(const struct pnm *pnm, size_t more) {
    size_t row = pnm->width * pnm->channels * pnm->bytes, stride = row + more;
    uint8_t *data = malloc(stride * pnm->height);
    memset(data, 0xa5, stride * pnm->height);
    for (size_t y = 0; y < pnm->height; y++) memcpy(data + y * stride, pnm->data + y * row, row);
    mrfgs_format format = pnm->bytes == 1 ? (pnm->channels == 1 ? MRFGS_FORMAT_GREY8 : MRFGS_FORMAT_RGB8)
                                          : (pnm->channels == 1 ? MRFGS_FORMAT_GREY16 : MRFGS_FORMAT_RGB16);
    mrfgs_image image = {data, stride, (uint32_t)pnm->width, (uint32_t)pnm->height, format};
    return image;
}

/* Whether the rows of a map are those of `expected`, and the bytes behind them untouched. */
static int same(const uint8_t *map, size_t stride, const struct pnm *expected) {
    size_t row = expected->width * expected->bytes;
    for (size_t y = 0; y < expected->height; y++) {
        if (memcmp(map + y * stride, expected->data + y * row, row) != 0) return 0;
        for (size_t x = row; x < stride; x++)
            if (map[y * stride + x] != 0x5a) return 0;
    }
    return 1;
}

static void compare(mrfgs_matcher *matcher, const struct pnm frames[2], mrfgs_range range, const struct pnm maps[3]) {
    for (size_t more = 0; more < 8; more += 7) {
        mrfgs_image left = spread(&frames[0], more), right = spread(&frames[1], 2 * more);
        uint8_t *found[3];
        size_t strides[3];
        for (int i = 0; i < 3; i++) {
            strides[i] = maps[i].width * maps[i].bytes + more;
            found[i] = malloc(strides[i] * maps[i].height);
            memset(found[i], 0x5a, strides[i] * maps[i].height);
        }
        mrfgs_maps all = {sizeof all, (float *)found[0], strides[0], found[1], strides[1], found[2], strides[2]};
        CHECK(mrfgs_match(matcher, &left, &right, &range, &all) == MRFGS_STATUS_OK);
        for (int i = 0; i < 3; i++) CHECK(same(found[i], strides[i], &maps[i]));
        /* Control: the comparison sees one bit. */
        found[0][strides[0]] ^= 1;
        CHECK(!same(found[0], strides[0], &maps[0]));
        /* One map alone. */
        memset(found[2], 0x5a, strides[2] * maps[2].height);
        mrfgs_maps one = {.size = sizeof one, .validity = found[2], .validity_stride = strides[2]};
        CHECK(mrfgs_match(matcher, &left, &right, &range, &one) == MRFGS_STATUS_OK);
        CHECK(same(found[2], strides[2], &maps[2]));
        for (int i = 0; i < 3; i++) free(found[i]);
        free((void *)left.data);
        free((void *)right.data);
    }
    CHECK(strlen(mrfgs_last_device()) > 0 && strlen(mrfgs_last_note()) == 0);
}

/* What is probably wrong is said, and only that. */
static void warnings(mrfgs_matcher *matcher, const struct pnm frames[2], mrfgs_range range) {
    mrfgs_image left = spread(&frames[0], 1), right = spread(&frames[1], 0);
    CHECK(mrfgs_check(&left, &right, &range) == MRFGS_STATUS_OK && strlen(mrfgs_last_warnings()) == 0);
    CHECK(mrfgs_check(&left, &left, NULL) == MRFGS_STATUS_OK && strstr(mrfgs_last_warnings(), "are the same"));
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_check(&left, NULL, NULL), "right", "null");
    size_t stride = frames[0].width * sizeof(float);
    float *disparity = malloc(stride * frames[0].height);
    mrfgs_maps maps = {.size = sizeof maps, .disparity = disparity, .disparity_stride = stride};
    mrfgs_range narrow = {range.min, range.max / 3};
    CHECK(mrfgs_match(matcher, &left, &right, &narrow, &maps) == MRFGS_STATUS_OK);
    CHECK(strstr(mrfgs_last_warnings(), "raise range.max"));
    free(disparity);
    free((void *)left.data);
    free((void *)right.data);
}

/* Every preset has a name by which it is taken. */
static void presets(void) {
    mrfgs_options *options = mrfgs_options_new();
    uint32_t count = 0, fast = 0;
    for (const char *name; (name = mrfgs_preset_name(count)) != NULL; count++) {
        CHECK(mrfgs_options_preset(options, name) == MRFGS_STATUS_OK);
        fast += strcmp(name, "fast") == 0;
    }
    CHECK(fast == 1 && count > 2 && strcmp(mrfgs_preset_name(0), "default") == 0);
    CHECK(mrfgs_preset_name(count + 1) == NULL && mrfgs_preset_name(UINT32_MAX) == NULL);
    mrfgs_options_free(options);
}

static void mistakes(mrfgs_options *options, mrfgs_matcher *matcher, const struct pnm frames[2]) {
    const mrfgs_status wrong = MRFGS_STATUS_ARGUMENT;
    refused(wrong, mrfgs_options_preset(NULL, "fast"), "options", "null");
    refused(wrong, mrfgs_options_preset(options, NULL), "name", "null");
    refused(wrong, mrfgs_options_preset(options, "quick"), "no preset `quick`", "fast");
    refused(wrong, mrfgs_options_preset(options, "\xff\xfe"), "name", "UTF-8");
    refused(wrong, mrfgs_options_set(options, "fil", "none"), "\"fil\"", "no such key");
    refused(wrong, mrfgs_options_set(options, "fill", "sand"), "\"fill\"", "sand");
    refused(wrong, mrfgs_options_set(options, NULL, "none"), "key", "null");
    refused(wrong, mrfgs_options_set(options, "fill", NULL), "value", "null");
    refused(wrong, mrfgs_options_device(options, NULL), "name", "null");
    refused(MRFGS_STATUS_FILE, mrfgs_options_load(options, "/none/such.toml"), "/none/such.toml", "cannot read");

    mrfgs_matcher *none = matcher;
    refused(wrong, mrfgs_matcher_new(options, NULL), "place", "null");
    mrfgs_options *other = mrfgs_options_new();
    CHECK(mrfgs_options_device(other, "no such device") == MRFGS_STATUS_OK);
    CHECK(mrfgs_matcher_new(other, &none) != MRFGS_STATUS_OK && none == NULL);
    mrfgs_options_free(other);
    mrfgs_options_free(NULL);
    mrfgs_matcher_free(NULL);
    refused(wrong, mrfgs_matcher_stop(NULL), "matcher", "null");

    mrfgs_image image = spread(&frames[0], 3), bad;
    size_t pixels = frames[0].width * frames[0].height;
    float *disparity = malloc(pixels * sizeof *disparity);
    for (size_t i = 0; i < pixels; i++) disparity[i] = -1;
    mrfgs_maps maps = {.size = sizeof maps, .disparity = disparity, .disparity_stride = frames[0].width * sizeof *disparity};
    mrfgs_range range = {0, 15};
    refused(wrong, mrfgs_match(NULL, &image, &image, &range, &maps), "matcher", "null");
    refused(wrong, mrfgs_match(matcher, NULL, &image, &range, &maps), "left", "null");
    refused(wrong, mrfgs_match(matcher, &image, NULL, &range, &maps), "right", "null");
    refused(wrong, mrfgs_match(matcher, &image, &image, &range, NULL), "maps", "null");
    bad = image, bad.data = NULL;
    refused(wrong, mrfgs_match(matcher, &bad, &image, &range, &maps), "left", "null");
    bad = image, bad.format = 77;
    refused(wrong, mrfgs_match(matcher, &image, &bad, &range, &maps), "right", "format 77");
    bad = image, bad.stride = 1;
    refused(wrong, mrfgs_match(matcher, &bad, &image, &range, &maps), "left", "stride of 1");
    bad = image, bad.stride = SIZE_MAX / 2;
    refused(wrong, mrfgs_match(matcher, &bad, &image, &range, &maps), "left", "no memory");
    bad = image, bad.width -= 1;
    refused(wrong, mrfgs_match(matcher, &image, &bad, &range, &maps), "one size", "121");
    bad = image, bad.height = 0;
    refused(wrong, mrfgs_match(matcher, &bad, &bad, &range, &maps), "holds no pixel", "0");
    mrfgs_range empty = {5, 4}, far = {0, 1 << 30};
    refused(wrong, mrfgs_match(matcher, &image, &image, &empty, &maps), "range", "raise range.max");
    refused(wrong, mrfgs_match(matcher, &image, &image, &far, &maps), "range", "1073741824");
    mrfgs_maps small = maps;
    small.disparity_stride -= 1;
    refused(wrong, mrfgs_match(matcher, &image, &image, &range, &small), "maps.disparity", "stride");
    small = maps, small.size = 8;
    refused(wrong, mrfgs_match(matcher, &image, &image, &range, &small), "maps.size is 8", "header");
    /* The next match is stopped, and the one after it is not. */
    CHECK(mrfgs_matcher_stop(matcher) == MRFGS_STATUS_OK);
    refused(MRFGS_STATUS_STOPPED, mrfgs_match(matcher, &image, &image, &range, &maps), "interrupted", "");
    for (size_t i = 0; i < pixels; i++) CHECK(disparity[i] == -1);
    CHECK(mrfgs_match(matcher, &image, &image, &range, &maps) == MRFGS_STATUS_OK);
    for (size_t i = 0; i < pixels; i++) CHECK(disparity[i] != -1);
    free(disparity);
    free((void *)image.data);
}

int main(int argc, char **argv) {
    if (argc != 7) return 2;
    CHECK(strlen(mrfgs_last_error()) == 0);
    presets();
    struct pnm frames[2] = {pnm_read(argv[1]), pnm_read(argv[2])};
    struct pnm maps[3] = {pnm_read(argv[4]), pnm_read(argv[5]), pnm_read(argv[6])};
    mrfgs_options *options = mrfgs_options_new();
    mrfgs_matcher *matcher;
    CHECK(mrfgs_options_preset(options, "fast") == MRFGS_STATUS_OK);
    CHECK(mrfgs_options_set(options, "memory", "512") == MRFGS_STATUS_OK);
    CHECK(mrfgs_options_device(options, "cpu") == MRFGS_STATUS_OK);
    CHECK(mrfgs_options_threads(options, 2) == MRFGS_STATUS_OK);
    CHECK(mrfgs_matcher_new(options, &matcher) == MRFGS_STATUS_OK);
    mrfgs_range range = {0, atoi(argv[3])};
    compare(matcher, frames, range, maps);
    warnings(matcher, frames, range);
    mistakes(options, matcher, frames);
    mrfgs_options_free(options);
    mrfgs_matcher_free(matcher);
    for (int i = 0; i < 2; i++) free(frames[i].data);
    for (int i = 0; i < 3; i++) free(maps[i].data);
    printf("match.c: mrfgs %s, %zu x %zu, %zu channels of %zu bytes: all maps are equal\n", mrfgs_version(), frames[0].width,
           frames[0].height, frames[0].channels, frames[0].bytes);
    return 0;
}
