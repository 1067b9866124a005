/* Matches frames with padded rows, and compares the maps with those of the program byte by byte.
 *
 *     match-c LEFT.pnm RIGHT.pnm MAX-DISPARITY MAP.pfm CONFIDENCE.pgm VALIDITY.pgm RIGHT-MAP.pfm SIGMA.pfm REGION.pfm STEADY.pfm KNOWN.pfm
 *
 * Then it makes every mistake that a caller can make, and matches again in a process that it forks. */
#if defined(__unix__) || defined(__APPLE__)
#define CAN_FORK 1
/* What C11 alone hides: fork and waitpid. */
#define _POSIX_C_SOURCE 200809L
#endif

#include "pnm.h"

#include <math.h>
#include <mrfgs.h>

#ifdef CAN_FORK
#include <sys/wait.h>
#include <unistd.h>
#endif

/* The first header had no map of the right view, the second no errors. */
#define FIRST_SIZE offsetof(mrfgs_maps, right)
#define SECOND_SIZE offsetof(mrfgs_maps, sigma)

#define CHECK(condition) check((condition) != 0, #condition, __LINE__)

static void check(int holds, const char *condition, int line) {
    if (!holds) {
        fprintf(stderr, "match.c:%d: %s; the last error: %s\n", line, condition, mrfgs_last_error());
        exit(1);
    }
}

/* Checks that the call fails with this status, and that its message contains all these words. */
static void refused(mrfgs_status expected, mrfgs_status status, const char *word, const char *other) {
    if (status != expected || !strstr(mrfgs_last_error(), word) || !strstr(mrfgs_last_error(), other)) {
        fprintf(stderr, "match.c: status %d and not %d, without `%s` or `%s`: %s\n", (int)status, (int)expected, word, other,
                mrfgs_last_error());
        exit(1);
    }
}

/* A frame with `more` bytes of padding after each row. */
static mrfgs_image spread(const struct pnm *pnm, size_t more) {
    size_t row = pnm->width * pnm->channels * pnm->bytes, stride = row + more;
    uint8_t *data = malloc(stride * pnm->height);
    memset(data, 0xa5, stride * pnm->height);
    for (size_t y = 0; y < pnm->height; y++) memcpy(data + y * stride, pnm->data + y * row, row);
    mrfgs_format format = pnm->bytes == 4   ? MRFGS_FORMAT_GREY32F
                          : pnm->bytes == 2 ? MRFGS_FORMAT_GREY16
                                            : (pnm->channels == 1 ? MRFGS_FORMAT_GREY8 : MRFGS_FORMAT_RGB8);
    mrfgs_image image = {data, stride, (uint32_t)pnm->width, (uint32_t)pnm->height, format};
    return image;
}

/* Whether the rows of a map equal `expected`, and the padding is untouched. */
static int same(const uint8_t *map, size_t stride, const struct pnm *expected) {
    size_t row = expected->width * expected->bytes;
    for (size_t y = 0; y < expected->height; y++) {
        if (memcmp(map + y * stride, expected->data + y * row, row) != 0) return 0;
        for (size_t x = row; x < stride; x++)
            if (map[y * stride + x] != 0x5a) return 0;
    }
    return 1;
}

static void compare(mrfgs_matcher *matcher, const struct pnm frames[2], mrfgs_range range, const struct pnm maps[5]) {
    for (size_t more = 0; more < 8; more += 7) {
        mrfgs_image left = spread(&frames[0], more), right = spread(&frames[1], 2 * more);
        uint8_t *found[5];
        size_t strides[5];
        for (int i = 0; i < 5; i++) {
            strides[i] = maps[i].width * maps[i].bytes + more;
            found[i] = malloc(strides[i] * maps[i].height);
            memset(found[i], 0x5a, strides[i] * maps[i].height);
        }
        mrfgs_maps all = {sizeof all, (float *)found[0], strides[0], found[1], strides[1], found[2], strides[2],
                          (float *)found[3], strides[3], (float *)found[4], strides[4]};
        CHECK(mrfgs_match(matcher, &left, &right, &range, &all) == MRFGS_STATUS_OK);
        for (int i = 0; i < 5; i++) CHECK(same(found[i], strides[i], &maps[i]));
        CHECK(memcmp(maps[0].data, maps[3].data, maps[0].width * maps[0].height * sizeof(float)) != 0);
        /* Callers compiled with earlier headers, which have shorter structures. */
        const size_t sizes[2] = {FIRST_SIZE, SECOND_SIZE};
        for (int n = 0; n < 2; n++) {
            mrfgs_maps *earlier = malloc(sizes[n]);
            memcpy(earlier, &all, sizes[n]);
            earlier->size = sizes[n];
            for (int i = 0; i < 5; i++) memset(found[i], 0x5a, strides[i] * maps[i].height);
            CHECK(mrfgs_match(matcher, &left, &right, &range, earlier) == MRFGS_STATUS_OK);
            for (int i = 0; i < 5; i++) CHECK(same(found[i], strides[i], &maps[i]) == (i < 3 + n));
            free(earlier);
        }
        /* Control: the comparison detects one flipped bit. */
        found[0][strides[0]] ^= 1;
        CHECK(!same(found[0], strides[0], &maps[0]));
        /* A single map. */
        memset(found[2], 0x5a, strides[2] * maps[2].height);
        mrfgs_maps one = {.size = sizeof one, .validity = found[2], .validity_stride = strides[2]};
        CHECK(mrfgs_match(matcher, &left, &right, &range, &one) == MRFGS_STATUS_OK);
        CHECK(same(found[2], strides[2], &maps[2]));
        for (int i = 0; i < 5; i++) free(found[i]);
        free((void *)left.data);
        free((void *)right.data);
    }
    CHECK(strlen(mrfgs_last_device()) > 0 && strlen(mrfgs_last_note()) == 0);
}

/* Converts a frame to another format: BGR, with alpha, or with 16 bits. */
static mrfgs_image converted(const struct pnm *pnm, mrfgs_format format, const uint8_t *mask) {
    int words = format == MRFGS_FORMAT_RGB16 || format == MRFGS_FORMAT_RGBA16 || format == MRFGS_FORMAT_BGR16 ||
                format == MRFGS_FORMAT_BGRA16;
    int bgr = format >= MRFGS_FORMAT_BGR8, alpha = format == MRFGS_FORMAT_RGBA8 || format == MRFGS_FORMAT_RGBA16 ||
                                                   format == MRFGS_FORMAT_BGRA8 || format == MRFGS_FORMAT_BGRA16;
    size_t channels = alpha ? 4 : 3, stride = pnm->width * channels * (words ? 2 : 1) + 3;
    uint8_t *data = malloc(stride * pnm->height);
    for (size_t y = 0; y < pnm->height; y++)
        for (size_t x = 0; x < pnm->width; x++)
            for (size_t c = 0; c < channels; c++) {
                size_t from = bgr && c < 3 ? 2 - c : c, at = x * channels + c;
                uint8_t value = c == 3 ? (mask && mask[y * pnm->width + x] ? 0 : 255) : pnm->data[(y * pnm->width + x) * 3 + from];
                uint16_t word = (uint16_t)(value * 257);
                memcpy(data + y * stride + at * (words ? 2 : 1), words ? (void *)&word : (void *)&value, words ? 2 : 1);
            }
    mrfgs_image image = {data, stride, (uint32_t)pnm->width, (uint32_t)pnm->height, format};
    return image;
}

/* A region gives the program's map of that region. */
static void region(mrfgs_matcher *matcher, const struct pnm frames[2], mrfgs_range range, const struct pnm *part) {
    mrfgs_image left = spread(&frames[0], 0), right = spread(&frames[1], 3);
    mrfgs_region at = {31, 20, 45, 30};
    CHECK(part->width == at.width && part->height == at.height);
    size_t bytes = part->width * part->height * sizeof(float);
    float *found = malloc(bytes);
    mrfgs_maps maps = {.size = sizeof maps, .disparity = found, .disparity_stride = part->width * sizeof(float)};
    CHECK(mrfgs_match_region(matcher, &left, &right, NULL, NULL, &range, &at, &maps) == MRFGS_STATUS_OK);
    CHECK(memcmp(found, part->data, bytes) == 0);
    /* Control: another region gives another map. */
    at.x += 1;
    CHECK(mrfgs_match_region(matcher, &left, &right, NULL, NULL, &range, &at, &maps) == MRFGS_STATUS_OK);
    CHECK(memcmp(found, part->data, bytes) != 0);
    at.x = UINT32_MAX;
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_match_region(matcher, &left, &right, NULL, NULL, &range, &at, &maps), "region", "not inside");
    free((void *)left.data);
    free((void *)right.data);
    free(found);
}

/* A prior gives the program's map: for its own map as a surface, `expected`. */
static void prior(mrfgs_matcher *matcher, const struct pnm frames[2], mrfgs_range range, const struct pnm *map,
                  const struct pnm *expected) {
    const mrfgs_status ok = MRFGS_STATUS_OK, wrong = MRFGS_STATUS_ARGUMENT;
    mrfgs_image left = spread(&frames[0], 0), right = spread(&frames[1], 3);
    size_t width = map->width, height = map->height, stride = width * sizeof(float), pixels = width * height, bytes = stride * height;
    float *found = malloc(bytes), *other = malloc(bytes), *given = malloc(bytes), *sigma = malloc(bytes);
    mrfgs_maps maps = {.size = sizeof maps, .disparity = found, .disparity_stride = stride};
    mrfgs_prior surface = {.size = sizeof surface, .disparity = (const float *)(const void *)map->data, .disparity_stride = stride,
                           .usual_sigma = 0.5, .kind = MRFGS_PRIOR_KIND_SURFACE};
    mrfgs_prior_use used;
    /* The preset matches at half the size. */
    const size_t all = (width + 1) / 2 * ((height + 1) / 2);
#define MATCH(known) mrfgs_match_prior(matcher, &left, &right, NULL, NULL, &range, NULL, (known), &maps)
    CHECK(MATCH(&surface) == ok);
    CHECK(memcmp(found, expected->data, bytes) == 0);
    CHECK(mrfgs_last_prior(&used) == ok && used.kind == MRFGS_PRIOR_KIND_SURFACE && used.given == all && used.dropped == 0);
    CHECK(used.trust > 0.9 && used.trust <= 1 && !strstr(mrfgs_last_warnings(), "prior"));
    /* Control: without it the map is another one, and nothing was used. */
    CHECK(MATCH(NULL) == ok);
    CHECK(memcmp(found, map->data, bytes) == 0 && memcmp(found, expected->data, bytes) != 0);
    CHECK(mrfgs_last_prior(&used) == ok && used.kind == 0 && used.given == 0 && used.dropped == 0 && used.trust == 0);
    /* The same by a map of standard deviations, half of them the usual ones, with padded rows; control: others give another map. */
    uint8_t *padded = malloc((stride + 5) * height);
    for (size_t i = 0; i < pixels; i++) sigma[i] = i % 2 ? 0.5f : 0;
    for (size_t y = 0; y < height; y++) memcpy(padded + y * (stride + 5), map->data + y * stride, stride);
    mrfgs_prior each = surface;
    each.disparity = (const float *)(void *)padded, each.disparity_stride = stride + 5, each.sigma = sigma, each.sigma_stride = stride;
    CHECK(MATCH(&each) == ok);
    CHECK(memcmp(found, expected->data, bytes) == 0);
    each.usual_sigma = 9;
    CHECK(MATCH(&each) == ok);
    CHECK(memcmp(found, expected->data, bytes) != 0);
    /* One that knows nothing changes nothing, neither as a map, nor in a region, nor as points. */
    for (size_t i = 0; i < pixels; i++) given[i] = i % 2 ? NAN : INFINITY;
    mrfgs_prior nothing = {.size = sizeof nothing, .disparity = given, .disparity_stride = stride};
    mrfgs_prior_point points[2048];
    CHECK(MATCH(&nothing) == ok);
    CHECK(memcmp(found, map->data, bytes) == 0);
    CHECK(mrfgs_last_prior(&used) == ok && used.kind == MRFGS_PRIOR_KIND_POINTS && used.given == 0);
    nothing.disparity = NULL, nothing.points = points;
    CHECK(MATCH(&nothing) == ok);
    CHECK(memcmp(found, map->data, bytes) == 0);
    /* A map of few known pixels, and the same ones as points; a tenth of them is off and dropped. */
    size_t count = 0;
    for (size_t y = 0; y < height; y += 3)
        for (size_t x = 0; x < width; x += 3) {
            float disparity = ((const float *)(const void *)map->data)[y * width + x];
            mrfgs_prior_point point = {(double)x, (double)y, disparity + (count % 10 == 5 ? 7.5 : 0), 0};
            given[y * width + x] = (float)point.disparity;
            points[count++] = point;
        }
    mrfgs_prior sparse = {.size = sizeof sparse, .disparity = given, .disparity_stride = stride};
    mrfgs_prior listed = {.size = sizeof listed, .points = points, .count = count};
    CHECK(MATCH(&sparse) == ok);
    CHECK(mrfgs_last_prior(&used) == ok && used.kind == MRFGS_PRIOR_KIND_POINTS && used.given == count && used.dropped > count / 20);
    maps.disparity = other;
    CHECK(MATCH(&listed) == ok);
    CHECK(memcmp(found, other, bytes) == 0 && memcmp(found, map->data, bytes) != 0);
    /* Control: their standard deviations count, whether all are set or each. */
    listed.usual_sigma = 3;
    CHECK(MATCH(&listed) == ok);
    CHECK(memcmp(found, other, bytes) != 0);
    maps.disparity = found;
    listed.usual_sigma = 0;
    for (size_t i = 0; i < count; i++) points[i].sigma = 3;
    CHECK(MATCH(&listed) == ok);
    CHECK(memcmp(found, other, bytes) == 0);
    /* One that the images contradict is not used, and a warning says so. */
    for (size_t i = 0; i < pixels; i++) given[i] = (float)range.max - ((const float *)(const void *)map->data)[i];
    sparse.kind = MRFGS_PRIOR_KIND_SURFACE;
    CHECK(MATCH(&sparse) == ok);
    CHECK(memcmp(found, map->data, bytes) == 0 && strstr(mrfgs_last_warnings(), "the images contradict the prior, so it was not used"));
    CHECK(mrfgs_last_prior(&used) == ok && used.trust == 0 && used.given == all);
    /* Mistakes, after which the map and the use are those of the match before. */
    memset(found, 0x5a, bytes);
    mrfgs_prior bad = surface;
    bad.size = 8, refused(wrong, MATCH(&bad), "prior.size is 8", "sizeof(mrfgs_prior) is ");
    bad = surface, bad.kind = 3, refused(wrong, MATCH(&bad), "prior.kind is 3", "0 to 2");
    bad = surface, bad.usual_sigma = -1, refused(wrong, MATCH(&bad), "prior.usual_sigma is -1", "above 0");
    bad = surface, bad.usual_sigma = NAN, refused(wrong, MATCH(&bad), "prior.usual_sigma is NaN", "above 0");
    bad = surface, bad.disparity_stride = stride - 1, refused(wrong, MATCH(&bad), "prior.disparity", "less than a row needs");
    bad = each, bad.sigma_stride = 7, refused(wrong, MATCH(&bad), "prior.sigma", "stride of 7");
    bad = surface, bad.points = points, refused(wrong, MATCH(&bad), "points and a map", "one of them");
    bad = surface, bad.disparity = NULL, refused(wrong, MATCH(&bad), "the prior is empty", "prior.points or prior.disparity");
    bad = surface, bad.count = 4, refused(wrong, MATCH(&bad), "prior.points is null", "prior.count");
    bad = listed, bad.kind = MRFGS_PRIOR_KIND_SURFACE, refused(wrong, MATCH(&bad), "prior.kind is a surface", "points");
    bad = listed, bad.sigma = sigma, refused(wrong, MATCH(&bad), "a map of sigma", "each point");
    points[1].sigma = -2, refused(wrong, MATCH(&listed), "point 2 of the prior", "-2 px");
    points[0].x = NAN, refused(wrong, MATCH(&listed), "point 1 of the prior", "not a number");
    points[0].x = -9, listed.count = 1, refused(wrong, MATCH(&listed), "none of the 1 points", "inside the left view");
    sigma[0] = -1, each.disparity = (const float *)(const void *)map->data, each.disparity_stride = stride;
    refused(wrong, MATCH(&each), "column 0, row 0", "-1 px");
    given[width + 2] = 1e9f, refused(wrong, MATCH(&sparse), "column 2, row 1", "1000000000 px");
    refused(wrong, mrfgs_last_prior(NULL), "place", "prior");
    CHECK(mrfgs_last_prior(&used) == ok && used.given == all);
    for (size_t i = 0; i < bytes; i++) CHECK(((const uint8_t *)found)[i] == 0x5a);
#undef MATCH
    free((void *)left.data), free((void *)right.data), free(found), free(other), free(given), free(sigma), free(padded);
}

/* All colour formats give the same map, and alpha acts as a mask. */
static void formats(mrfgs_matcher *matcher, const struct pnm frames[2], mrfgs_range range, const struct pnm *map) {
    size_t pixels = map->width * map->height, stride = map->width * sizeof(float);
    float *found = malloc(pixels * sizeof *found), *masked = malloc(pixels * sizeof *masked);
    mrfgs_maps maps = {.size = sizeof maps, .disparity = found, .disparity_stride = stride};
    for (mrfgs_format format = MRFGS_FORMAT_RGB8; format <= MRFGS_FORMAT_BGRA16; format++) {
        if (format == MRFGS_FORMAT_GREY32F) continue;
        mrfgs_image left = converted(&frames[0], format, NULL), right = converted(&frames[1], format, NULL);
        CHECK(mrfgs_match(matcher, &left, &right, &range, &maps) == MRFGS_STATUS_OK);
        CHECK(memcmp(found, map->data, pixels * sizeof *found) == 0);
        /* Control: the order of the channels matters. */
        right.format = format == MRFGS_FORMAT_RGB8 ? MRFGS_FORMAT_BGR8 : right.format;
        CHECK(mrfgs_match(matcher, &left, &right, &range, &maps) == MRFGS_STATUS_OK);
        CHECK((memcmp(found, map->data, pixels * sizeof *found) == 0) == (format != MRFGS_FORMAT_RGB8));
        free((void *)left.data);
        free((void *)right.data);
    }
    uint8_t *left_mask = calloc(pixels, 1), *right_mask = calloc(pixels, 1);
    for (size_t i = 0; i < pixels; i++) left_mask[i] = i % map->width < 9, right_mask[i] = i / map->width > 70 ? 255 : 0;
    mrfgs_image masks[2] = {{left_mask, map->width, (uint32_t)map->width, (uint32_t)map->height, MRFGS_FORMAT_GREY8},
                            {right_mask, map->width, (uint32_t)map->width, (uint32_t)map->height, MRFGS_FORMAT_GREY8}};
    mrfgs_image plain[2] = {spread(&frames[0], 1), spread(&frames[1], 2)};
    mrfgs_image alpha[2] = {converted(&frames[0], MRFGS_FORMAT_BGRA8, left_mask), converted(&frames[1], MRFGS_FORMAT_RGBA8, right_mask)};
    CHECK(mrfgs_match(matcher, &alpha[0], &alpha[1], &range, &maps) == MRFGS_STATUS_OK);
    maps.disparity = masked;
    CHECK(mrfgs_match_masked(matcher, &plain[0], &plain[1], &masks[0], &masks[1], &range, &maps) == MRFGS_STATUS_OK);
    CHECK(memcmp(found, masked, pixels * sizeof *found) == 0);
    for (size_t i = 0; i < pixels; i++) CHECK((masked[i] > 1e30f) == (left_mask[i] != 0));
    /* Control: the mask of the right image matters, too. */
    CHECK(mrfgs_match_masked(matcher, &plain[0], &plain[1], &masks[0], NULL, &range, &maps) == MRFGS_STATUS_OK);
    CHECK(memcmp(found, masked, pixels * sizeof *found) != 0);
    memset(left_mask, 1, pixels);
    CHECK(mrfgs_check_masked(&plain[0], &plain[1], &masks[0], NULL, &range) == MRFGS_STATUS_OK);
    CHECK(strstr(mrfgs_last_warnings(), "masked everywhere"));
    mrfgs_image bad = masks[0];
    bad.format = MRFGS_FORMAT_GREY16, bad.stride = 999;
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_match_masked(matcher, &plain[0], &plain[1], &bad, NULL, &range, &maps), "mask of the left", "GREY8");
    bad = masks[1], bad.height -= 1;
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_match_masked(matcher, &plain[0], &plain[1], NULL, &bad, &range, &maps), "mask of the right", "89");
    bad = masks[1], bad.data = NULL;
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_check_masked(&plain[0], &plain[1], NULL, &bad, &range), "mask of the right", "null");
    for (int i = 0; i < 2; i++) free((void *)plain[i].data), free((void *)alpha[i].data);
    free(left_mask);
    free(right_mask);
    free(found);
    free(masked);
}

/* Likely problems are reported, and nothing else. */
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

/* Every preset is accepted by its name. */
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
    refused(wrong, mrfgs_options_set(options, "fill", "sand"), "none", "row");
    refused(wrong, mrfgs_options_set(options, "levels", "17"), "\"levels\"", "1 to 16");
    refused(wrong, mrfgs_options_threads(options, 1025), "threads is 1025", "1 to 1024");
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
    refused(wrong, mrfgs_match(matcher, &image, &bad, &range, &maps), "right", "format 77; give an mrfgs_format, 1 to 11");
    bad = image, bad.stride = 1;
    refused(wrong, mrfgs_match(matcher, &bad, &image, &range, &maps), "left", "stride of 1");
    bad = image, bad.stride = SIZE_MAX / 2;
    refused(wrong, mrfgs_match(matcher, &bad, &image, &range, &maps), "left", "too large for memory");
    bad = image, bad.width -= 1;
    refused(wrong, mrfgs_match(matcher, &image, &bad, &range, &maps), "the same size", "121");
    bad = image, bad.height = 0;
    refused(wrong, mrfgs_match(matcher, &bad, &bad, &range, &maps), "has no pixels", "0");
    mrfgs_range empty = {5, 4}, far = {0, 1 << 30};
    refused(wrong, mrfgs_match(matcher, &image, &image, &empty, &maps), "range", "raise range.max");
    refused(wrong, mrfgs_match(matcher, &image, &image, &far, &maps), "range", "1073741824");
    mrfgs_maps small = maps;
    small.disparity_stride -= 1;
    refused(wrong, mrfgs_match(matcher, &image, &image, &range, &small), "maps.disparity", "stride");
    small = maps, small.right = disparity, small.right_stride = 3;
    refused(wrong, mrfgs_match(matcher, &image, &image, &range, &small), "maps.right", "stride");
    small = maps, small.size = FIRST_SIZE + 1;
    refused(wrong, mrfgs_match(matcher, &image, &image, &range, &small), "maps.size is 57", "sizeof(mrfgs_maps) is 88");
    small = maps, small.size = 8;
    refused(wrong, mrfgs_match(matcher, &image, &image, &range, &small), "maps.size is 8", "header");
    /* Cancels the next match, but not the one after it. */
    CHECK(mrfgs_matcher_stop(matcher) == MRFGS_STATUS_OK);
    refused(MRFGS_STATUS_STOPPED, mrfgs_match(matcher, &image, &image, &range, &maps), "interrupted", "");
    for (size_t i = 0; i < pixels; i++) CHECK(disparity[i] == -1);
    CHECK(mrfgs_match(matcher, &image, &image, &range, &maps) == MRFGS_STATUS_OK);
    for (size_t i = 0; i < pixels; i++) CHECK(disparity[i] != -1);
    free(disparity);
    free((void *)image.data);
}

/* The frame follows one that showed LEFT twice, and was more certain: the program's map is `expected`. */
static void steady(mrfgs_matcher *matcher, const struct pnm frames[2], mrfgs_range range, const struct pnm *expected) {
    mrfgs_image left = spread(&frames[0], 3), right = spread(&frames[1], 0);
    size_t width = left.width, height = left.height, stride = width * sizeof(float) + 5, bytes = stride * height;
    uint8_t *disparity = malloc(bytes), *confidence = malloc(width * height), *validity = malloc(width * height);
    mrfgs_maps maps = {.size = sizeof maps, .disparity = (float *)(void *)disparity, .disparity_stride = stride, .confidence = confidence,
                       .confidence_stride = width, .validity = validity, .validity_stride = width}, part = maps;
    memset(disparity, 0x5a, bytes);
    mrfgs_steady *filter;
    CHECK(mrfgs_steady_new(&filter) == MRFGS_STATUS_OK);
    CHECK(mrfgs_match(matcher, &left, &left, &range, &maps) == MRFGS_STATUS_OK);
    CHECK(mrfgs_steady_follow(filter, &left, &maps) == MRFGS_STATUS_OK);
    CHECK(mrfgs_match(matcher, &left, &right, &range, &maps) == MRFGS_STATUS_OK);
    /* Control: without that history the map differs. */
    CHECK(!same(disparity, stride, expected));
    CHECK(mrfgs_steady_follow(filter, &left, &maps) == MRFGS_STATUS_OK);
    CHECK(same(disparity, stride, expected));
    part.confidence = NULL;
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_steady_follow(filter, &left, &part), "maps.confidence", "null");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_steady_follow(NULL, &left, &maps), "steady", "null");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_steady_follow(filter, NULL, &maps), "left image", "null");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_steady_follow(filter, &left, NULL), "maps", "null");
    part = maps, part.disparity_stride = 7;
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_steady_follow(filter, &left, &part), "maps.disparity", "stride of 7");
    refused(MRFGS_STATUS_ARGUMENT, mrfgs_steady_new(NULL), "place", "steady");
    CHECK(same(disparity, stride, expected));
    mrfgs_steady_free(filter);
    mrfgs_steady_free(NULL);
    free((void *)left.data), free((void *)right.data), free(disparity), free(confidence), free(validity);
}

#ifdef CAN_FORK
/* A child of a process that has matched finds the same map, with the matcher of its parent and with one of its own, and ends. */
static void forked(const mrfgs_options *options, mrfgs_matcher *matcher, const struct pnm frames[2], mrfgs_range range,
                   const struct pnm *expected) {
    mrfgs_image left = spread(&frames[0], 0), right = spread(&frames[1], 0);
    size_t bytes = expected->width * expected->height * sizeof(float);
    float *found = malloc(bytes);
    mrfgs_maps maps = {.size = sizeof maps, .disparity = found, .disparity_stride = expected->width * sizeof(float)};
    CHECK(mrfgs_match(matcher, &left, &right, &range, &maps) == MRFGS_STATUS_OK);
    CHECK(memcmp(found, expected->data, bytes) == 0);
    fflush(NULL);
    pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        /* What hangs is killed. */
        alarm(300);
        mrfgs_matcher *own;
        CHECK(mrfgs_matcher_new(options, &own) == MRFGS_STATUS_OK);
        mrfgs_matcher *matchers[2] = {matcher, own};
        for (int i = 0; i < 2; i++) {
            memset(found, 0, bytes);
            CHECK(mrfgs_match(matchers[i], &left, &right, &range, &maps) == MRFGS_STATUS_OK);
            CHECK(memcmp(found, expected->data, bytes) == 0);
        }
        mrfgs_matcher_free(own);
    }
    if (child != 0) {
        int status;
        CHECK(waitpid(child, &status, 0) == child);
        CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
        memset(found, 0, bytes);
        CHECK(mrfgs_match(matcher, &left, &right, &range, &maps) == MRFGS_STATUS_OK);
        CHECK(memcmp(found, expected->data, bytes) == 0);
    }
    free((void *)left.data);
    free((void *)right.data);
    free(found);
    if (child == 0) {
        mrfgs_matcher_free(matcher);
        exit(0);
    }
}
#endif

int main(int argc, char **argv) {
    if (argc != 12) return 2;
    CHECK(strlen(mrfgs_last_error()) == 0);
    presets();
    struct pnm frames[2] = {pnm_read(argv[1]), pnm_read(argv[2])};
    struct pnm maps[5];
    for (int i = 0; i < 5; i++) maps[i] = pnm_read(argv[4 + i]);
    mrfgs_options *options = mrfgs_options_new();
    mrfgs_matcher *matcher;
    CHECK(mrfgs_options_preset(options, "fast") == MRFGS_STATUS_OK);
    CHECK(mrfgs_options_set(options, "memory", "512") == MRFGS_STATUS_OK);
    CHECK(mrfgs_options_device(options, "cpu") == MRFGS_STATUS_OK);
    CHECK(mrfgs_options_threads(options, 2) == MRFGS_STATUS_OK);
    CHECK(mrfgs_matcher_new(options, &matcher) == MRFGS_STATUS_OK);
    mrfgs_range range = {0, atoi(argv[3])};
    compare(matcher, frames, range, maps);
    struct pnm part = pnm_read(argv[9]);
    region(matcher, frames, range, &part);
    free(part.data);
    struct pnm led = pnm_read(argv[10]);
    /* 16-bit and float images are scaled by both views of a pair, but the filter sees only one. */
    if (frames[0].bytes == 1) steady(matcher, frames, range, &led);
    free(led.data);
    struct pnm known = pnm_read(argv[11]);
    prior(matcher, frames, range, &maps[0], &known);
    free(known.data);
    if (frames[0].channels == 3) formats(matcher, frames, range, &maps[0]);
    warnings(matcher, frames, range);
    mistakes(options, matcher, frames);
#ifdef CAN_FORK
    forked(options, matcher, frames, range, &maps[0]);
#endif
    mrfgs_options_free(options);
    mrfgs_matcher_free(matcher);
    for (int i = 0; i < 2; i++) free(frames[i].data);
    for (int i = 0; i < 5; i++) free(maps[i].data);
    printf("match.c: mrfgs %s, %zu x %zu, %zu channels of %zu bytes: all maps are equal\n", mrfgs_version(), frames[0].width,
           frames[0].height, frames[0].channels, frames[0].bytes);
    return 0;
}
