/* Reads frames and maps: PGM, PPM and grey PFM with its rows from bottom to top. Converts samples to little-endian, the byte order of the
 * test machines. */
#ifndef PNM_H
#define PNM_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct pnm {
    size_t width, height, channels, bytes;
    uint8_t *data;
};

static struct pnm pnm_read(const char *path) {
    struct pnm pnm = {0, 0, 1, 1, NULL};
    FILE *file = fopen(path, "rb");
    char kind = 0;
    double white = 0;
    if (!file || fscanf(file, "P%c %zu %zu %lf", &kind, &pnm.width, &pnm.height, &white) != 4 || fgetc(file) != '\n') {
        fprintf(stderr, "%s is no PNM or PFM\n", path);
        exit(2);
    }
    pnm.channels = kind == '6' ? 3 : 1;
    pnm.bytes = kind == 'f' ? 4 : white > 255 ? 2 : 1;
    size_t row = pnm.width * pnm.channels * pnm.bytes;
    pnm.data = (uint8_t *)malloc(row * pnm.height);
    for (size_t y = 0; y < pnm.height; y++) {
        uint8_t *to = pnm.data + (kind == 'f' ? pnm.height - 1 - y : y) * row;
        if (fread(to, 1, row, file) != row) exit(2);
        for (size_t i = 0; pnm.bytes == 2 && i < row; i += 2) {
            uint8_t high = to[i];
            to[i] = to[i + 1];
            to[i + 1] = high;
        }
    }
    fclose(file);
    return pnm;
}

#endif
