/* Sums over rows of numbers, by so many at once as compilers turn into vectors of every machine: in the same order, so
 * with the same bits, whatever the vectors are. */
#ifndef VIBROIMPACT_ROWS_H
#define VIBROIMPACT_ROWS_H

/* Rows are read by whole lanes: they have room for them, and zeros behind their last number. */
enum { VI_LANES = 2 };

/* Numbers that rows of `count` are read over. */
#define VI_WHOLE_LANES(count) (((count) + VI_LANES - 1) / VI_LANES * VI_LANES)

/* Sum of the products of two rows; width: whole lanes. */
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

/* row += factor * other */
static inline void vi_row_add(double *restrict row, double factor, const double *restrict other, int width)
{
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            row[j + i] += factor * other[j + i];
        }
    }
}

#endif
