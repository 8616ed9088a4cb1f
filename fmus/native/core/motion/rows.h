/* Sums over rows of numbers, several at once so that compilers make vectors for every machine. The order of the sums is
 * fixed: their bits are the same whatever the vectors are. */
#ifndef VIBROIMPACT_ROWS_H
#define VIBROIMPACT_ROWS_H

#include <stddef.h>

/* Rows are read by whole lanes: each row has room for them, with zeros behind its last number. */
enum { VI_LANES = 2 };

/* Numbers that are read from a row of `count` numbers. */
#define VI_WHOLE_LANES(count) (((count) + VI_LANES - 1) / VI_LANES * VI_LANES)

/* Sum of the products of two rows; width: numbers in whole lanes. */
static inline double vi_row_dot(const double *restrict a, const double *restrict b, int width)
{
    double sum[VI_LANES] = {0.0};
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            sum[i] += a[j + i] * b[j + i];
        }
    }
    return sum[0] + sum[1];
}

/* Rows whose sums are found side by side, since each sum waits for its last product. */
enum { VI_ROWS_ABREAST = 4 };

/* Sums of the products of VI_ROWS_ABREAST rows with one row, each with the bits of vi_row_dot; stride: from row to
 * row. */
static inline void vi_rows_dot_abreast(const double *restrict rows, int stride, const double *restrict b, int width,
                                       double dots[])
{
    const double *restrict second = rows + stride, *restrict third = second + stride, *restrict fourth = third + stride;
    double sum[VI_ROWS_ABREAST][VI_LANES] = {{0.0}};
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            sum[0][i] += rows[j + i] * b[j + i];
            sum[1][i] += second[j + i] * b[j + i];
            sum[2][i] += third[j + i] * b[j + i];
            sum[3][i] += fourth[j + i] * b[j + i];
        }
    }
    for (int r = 0; r < VI_ROWS_ABREAST; ++r) {
        dots[r] = sum[r][0] + sum[r][1];
    }
}

/* Sums of the products of `count` rows with one row. */
static inline void vi_rows_dot(int count, const double *restrict rows, int stride, const double *restrict b, int width,
                               double dots[])
{
    int r = 0;
    for (; r + VI_ROWS_ABREAST <= count; r += VI_ROWS_ABREAST) {
        vi_rows_dot_abreast(rows + r * stride, stride, b, width, dots + r);
    }
    for (; r < count; ++r) {
        dots[r] = vi_row_dot(rows + r * stride, b, width);
    }
}

/* row += factor * other */
static inline void vi_row_add(double *restrict row, double factor, const double *restrict other, int width)
{
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            row[j + i] += factor * other[j + i];
        }
    }
}

/* Two numbers, wherever they are. GNU vector extensions: gcc, clang and zig have them on every machine. */
typedef double vi_pair __attribute__((vector_size(16), aligned(8), may_alias));

/* Width of a block of columns of a table. */
enum { VI_COLUMNS = 8 };

/* One block of vi_rows_combine. */
static inline void vi_rows_combine_block(double *restrict value, const double *restrict row, ptrdiff_t stride,
                                         const double *restrict weight, int count)
{
    vi_pair *const to = (vi_pair *)value;
    vi_pair a = to[0], b = to[1], c = to[2], d = to[3];
    for (int n = 0; n < count; ++n, row += stride) {
        const vi_pair *const from = (const vi_pair *)row, factor = {weight[n], weight[n]};
        a += factor * from[0];
        b += factor * from[1];
        c += factor * from[2];
        d += factor * from[3];
    }
    to[0] = a;
    to[1] = b;
    to[2] = c;
    to[3] = d;
}

/* Two blocks of vi_rows_combine side by side, since each sum waits for its last product. */
static inline void vi_rows_combine_blocks(double *restrict value, const double *restrict row, ptrdiff_t stride,
                                          const double *restrict weight, int count)
{
    vi_pair *const to = (vi_pair *)value;
    vi_pair a = to[0], b = to[1], c = to[2], d = to[3], e = to[4], f = to[5], g = to[6], h = to[7];
    for (int n = 0; n < count; ++n, row += stride) {
        const vi_pair *const from = (const vi_pair *)row, factor = {weight[n], weight[n]};
        a += factor * from[0];
        b += factor * from[1];
        c += factor * from[2];
        d += factor * from[3];
        e += factor * from[4];
        f += factor * from[5];
        g += factor * from[6];
        h += factor * from[7];
    }
    to[0] = a;
    to[1] = b;
    to[2] = c;
    to[3] = d;
    to[4] = e;
    to[5] = f;
    to[6] = g;
    to[7] = h;
}

/* value += weight[0] * row 0 + weight[1] * row 1 + ... of a table whose rows are `stride` numbers apart. The sums are
 * in the order of the rows. width: a multiple of VI_COLUMNS. */
static inline void vi_rows_combine(double *restrict value, const double *restrict table, ptrdiff_t stride,
                                   const double *restrict weight, int count, int width)
{
    int i = 0;
    for (; i + 2 * VI_COLUMNS <= width; i += 2 * VI_COLUMNS) {
        vi_rows_combine_blocks(value + i, table + i, stride, weight, count);
    }
    if (i < width) {
        vi_rows_combine_block(value + i, table + i, stride, weight, count);
    }
}

#endif
