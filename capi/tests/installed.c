/* Tests an installed library: matches a pair with disparity 5 everywhere. scripts/release runs it where there is no compiler. */
#include <mrfgs.h>

#include <stdint.h>
#include <stdio.h>

enum { WIDTH = 80, HEIGHT = 60, SHIFT = 5 };

int main(void) {
    static uint8_t left[HEIGHT][WIDTH], right[HEIGHT][WIDTH];
    static float disparity[HEIGHT][WIDTH];
    uint32_t random = 1;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH + SHIFT; x++) {
            random = random * 1664525 + 1013904223;
            if (x < WIDTH) left[y][x] = (uint8_t)(random >> 24);
            if (x >= SHIFT) right[y][x - SHIFT] = (uint8_t)(random >> 24);
        }
    mrfgs_image views[2] = {{left[0], WIDTH, WIDTH, HEIGHT, MRFGS_FORMAT_GREY8}, {right[0], WIDTH, WIDTH, HEIGHT, MRFGS_FORMAT_GREY8}};
    mrfgs_range range = {0, 15};
    mrfgs_maps maps = {.size = sizeof maps, .disparity = disparity[0], .disparity_stride = WIDTH * sizeof(float)};
    mrfgs_matcher *matcher;
    if (mrfgs_matcher_new(NULL, &matcher) != MRFGS_STATUS_OK ||
        mrfgs_match(matcher, &views[0], &views[1], &range, &maps) != MRFGS_STATUS_OK) {
        fprintf(stderr, "%s\n", mrfgs_last_error());
        return 1;
    }
    mrfgs_matcher_free(matcher);
    float middle = disparity[HEIGHT / 2][WIDTH / 2];
    printf("libmrfgs %s: a disparity of %.2f\n", mrfgs_version(), middle);
    return middle < SHIFT - 0.5F || middle > SHIFT + 0.5F;
}
