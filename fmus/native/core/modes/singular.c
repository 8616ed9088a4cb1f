#include "modes/singular.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "modes/reflection.h"

/* Cosine of the angle of two vectors up to which they are orthogonal: the rounding of a scalar product of 64 terms. */
static const double ORTHOGONAL = 8.0 * DBL_EPSILON;
enum { MOST_SWEEPS = 60 }; /* ten are usual */

/* The matrix as P_rows X D Y' P_columns: X below the diagonal, D on the diagonal, Y' above the diagonal. */
typedef struct {
    int rows, columns;
    double (*a)[VI_MODES];
    int row[VI_ROWS], column[VI_MODES]; /* origins of the rows and columns */
} elimination;

static void swap_vectors(int n, double x[], double y[])
{
    for (int i = 0; i < n; ++i) {
        const double kept = x[i];
        x[i] = y[i];
        y[i] = kept;
    }
}

static void bring_pivot(elimination *e, int step, int pivot_row, int pivot_column)
{
    swap_vectors(e->columns, e->a[step], e->a[pivot_row]);
    for (int i = 0; i < e->rows; ++i) {
        const double kept = e->a[i][step];
        e->a[i][step] = e->a[i][pivot_column];
        e->a[i][pivot_column] = kept;
    }
    const int row = e->row[step], column = e->column[step];
    e->row[step] = e->row[pivot_row];
    e->row[pivot_row] = row;
    e->column[step] = e->column[pivot_column];
    e->column[pivot_column] = column;
}

/* Bring the largest remaining entry to the diagonal; false when all are 0. */
static bool pivot(elimination *e, int step)
{
    double largest = 0.0;
    int row = step, column = step;
    for (int i = step; i < e->rows; ++i) {
        for (int j = step; j < e->columns; ++j) {
            if (fabs(e->a[i][j]) > largest) {
                largest = fabs(e->a[i][j]);
                row = i;
                column = j;
            }
        }
    }
    bring_pivot(e, step, row, column);
    return largest > 0.0;
}

/* Gaussian elimination with complete pivoting. Without cycles every filled-in entry was 0, so nothing is ever
 * subtracted. Every entry of X, D, Y keeps its relative accuracy, and zeros are exact. Returns the rank. */
static int eliminate(elimination *e)
{
    int step = 0;
    for (; step < e->rows && step < e->columns && pivot(e, step); ++step) {
        const double *from = e->a[step];
        for (int i = step + 1; i < e->rows; ++i) {
            double *into = e->a[i];
            into[step] /= from[step];
            for (int j = step + 1; j < e->columns; ++j) {
                into[j] -= into[step] * from[j];
            }
        }
        for (int j = step + 1; j < e->columns; ++j) {
            e->a[step][j] /= from[step];
        }
    }
    return step;
}

/* X = Q R by Householder's reflections. x[k] is column k on entry, and the unit vector of reflection k afterwards. r[k]
 * is column k of the upper triangle R. */
static void factor(int rows, int rank, double x[][VI_ROWS], double r[][VI_ROWS])
{
    for (int k = 0; k < rank; ++k) {
        double *v = x[k];
        const double length = sqrt(vi_dot(rows - k, v + k, v + k));
        const double diagonal = v[k] > 0.0 ? -length : length;
        memcpy(r[k], v, (size_t)k * sizeof *v);
        r[k][k] = diagonal;
        v[k] -= diagonal;
        const double size = sqrt(vi_dot(rows - k, v + k, v + k)); /* >= length, as X has full rank */
        for (int i = k; i < rows; ++i) {
            v[i] /= size;
        }
        for (int later = k + 1; later < rank; ++later) {
            vi_reflect(rows - k, v + k, x[later] + k);
        }
    }
}

/* Row k of R D Y', in the order of the columns of a. The pivots do not grow with j, so the terms of a row are at most
 * of the size of its pivot. Their rounding is small beside the row. */
static void product_row(const elimination *e, int rank, int k, const double (*r)[VI_ROWS], double row[])
{
    for (int i = 0; i < e->columns; ++i) {
        double sum = 0.0;
        for (int j = k; j < rank && j <= i; ++j) {
            const double y = i == j ? 1.0 : e->a[j][i];
            sum += r[j][k] * e->a[j][j] * y;
        }
        row[e->column[i]] = sum;
    }
}

static void rotate(int n, double cosine, double sine, double x[], double y[])
{
    for (int i = 0; i < n; ++i) {
        const double kept = x[i];
        x[i] = cosine * kept - sine * y[i];
        y[i] = sine * kept + cosine * y[i];
    }
}

/* Make two vectors orthogonal, the longer one first, and rotate their left companions alike. False: they were. */
static bool orthogonalise(int columns, int rank, vi_singular *s, int first, int second)
{
    double *x = s->right[first], *y = s->right[second];
    if (vi_dot(columns, x, x) < vi_dot(columns, y, y)) {
        swap_vectors(columns, x, y);
        swap_vectors(rank, s->left[first], s->left[second]);
    }
    const double a = vi_dot(columns, x, x), b = vi_dot(columns, y, y), c = vi_dot(columns, x, y);
    if (!(fabs(c) > ORTHOGONAL * sqrt(a) * sqrt(b))) {
        return false;
    }
    const double cotangent = (b - a) / (2.0 * c); /* of twice the angle */
    const double tangent = copysign(1.0, cotangent) / (fabs(cotangent) + sqrt(1.0 + cotangent * cotangent));
    const double cosine = 1.0 / sqrt(1.0 + tangent * tangent);
    rotate(columns, cosine, cosine * tangent, x, y);
    rotate(rank, cosine, cosine * tangent, s->left[first], s->left[second]);
    return true;
}

/* One-sided Jacobi: afterwards right[k] = value k times its vector, and the left[k] are orthonormal. */
static bool orthogonalise_all(int columns, int rank, vi_singular *s)
{
    bool moved = true;
    for (int sweep = 0; moved && sweep < MOST_SWEEPS; ++sweep) {
        moved = false;
        for (int first = 0; first < rank; ++first) {
            for (int second = first + 1; second < rank; ++second) {
                moved = orthogonalise(columns, rank, s, first, second) || moved;
            }
        }
    }
    return !moved;
}

/* Turn coordinates in the columns of Q into left vectors. */
static void leave_reflections(const elimination *e, int rank, const double (*reflection)[VI_ROWS], double left[])
{
    double x[VI_ROWS] = {0.0};
    memcpy(x, left, (size_t)rank * sizeof *x);
    for (int k = rank - 1; k >= 0; --k) {
        vi_reflect(e->rows - k, reflection[k] + k, x + k);
    }
    for (int i = 0; i < e->rows; ++i) {
        left[e->row[i]] = x[i];
    }
}

static void sort_and_normalise(int rows, int columns, vi_singular *s)
{
    for (int k = 0; k < s->rank; ++k) {
        s->value[k] = sqrt(vi_dot(columns, s->right[k], s->right[k]));
        for (int i = 0; i < columns; ++i) {
            s->right[k][i] /= s->value[k];
        }
        for (int lower = k; lower > 0 && s->value[lower] < s->value[lower - 1]; --lower) {
            swap_vectors(1, &s->value[lower], &s->value[lower - 1]);
            swap_vectors(columns, s->right[lower], s->right[lower - 1]);
            swap_vectors(rows, s->left[lower], s->left[lower - 1]);
        }
    }
}

static bool finite_matrix(int rows, int columns, double (*a)[VI_MODES])
{
    for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) {
            if (!isfinite(a[i][j])) {
                return false;
            }
        }
    }
    return true;
}

static elimination begin(int rows, int columns, double (*a)[VI_MODES])
{
    elimination e = {.rows = rows, .columns = columns, .a = a};
    for (int i = 0; i < rows; ++i) {
        e.row[i] = i;
    }
    for (int j = 0; j < columns; ++j) {
        e.column[j] = j;
    }
    return e;
}

/* Copy the columns of the unit lower triangle X. */
static void columns_of_x(const elimination *e, int rank, double x[][VI_ROWS])
{
    for (int k = 0; k < rank; ++k) {
        for (int i = 0; i < e->rows; ++i) {
            x[k][i] = i < k ? 0.0 : i == k ? 1.0 : e->a[i][k];
        }
    }
}

bool vi_singular_find(int rows, int columns, double a[][VI_MODES], vi_singular *singular)
{
    if (!finite_matrix(rows, columns, a)) {
        return false;
    }
    memset(singular, 0, sizeof *singular);
    elimination e = begin(rows, columns, a);
    const int rank = singular->rank = eliminate(&e);
    double x[VI_MODES][VI_ROWS];
    columns_of_x(&e, rank, x);
    factor(rows, rank, x, singular->left); /* `left` holds R until the next loop is done */
    for (int k = 0; k < rank; ++k) {
        product_row(&e, rank, k, (const double (*)[VI_ROWS])singular->left, singular->right[k]);
    }
    memset(singular->left, 0, sizeof singular->left);
    for (int k = 0; k < rank; ++k) {
        singular->left[k][k] = 1.0;
    }
    const bool converged = orthogonalise_all(columns, rank, singular);
    for (int k = 0; k < rank; ++k) {
        leave_reflections(&e, rank, (const double (*)[VI_ROWS])x, singular->left[k]);
    }
    sort_and_normalise(rows, columns, singular);
    return converged;
}
