/* Sums over rows of numbers, several at once so that compilers make vectors for every machine. The order of the sums is
 * fixed: their bits are the same whatever the vectors are. */
#ifndef VIBROIMPACT_ROWS_H
#define VIBROIMPACT_ROWS_H

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
