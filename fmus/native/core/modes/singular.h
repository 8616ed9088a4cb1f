/* Singular values and vectors of matrices without cycles, each to high relative accuracy. */
#ifndef VIBROIMPACT_SINGULAR_H
#define VIBROIMPACT_SINGULAR_H

#include <stdbool.h>

#include "sizes.h"

/* Rows of a matrix at most: the springs of a chain, or the modes of a body and the stops that it presses. */
enum { VI_ROWS = VI_MODES + VI_PORTS };

typedef struct {
    int rank;                                /* singular values above 0; it is exact for a matrix without cycles */
    double value[VI_MODES];                  /* those, ascending */
    double left[VI_MODES][VI_ROWS];     /* left[k]: unit vector of value k, one component for each row */
    double right[VI_MODES][VI_MODES];        /* right[k]: likewise, one component for each column */
} vi_singular;

/* Of the rows x columns matrix a[row][column], at most VI_ROWS x VI_MODES, which is overwritten.
 *
 * For a matrix without cycles (its entries are edges between rows and columns that form no closed path, as between
 * the springs and the masses of a chain) the error of every singular value is a few roundings relative to that value,
 * however many decades the entries span: Demmel, Gu, Eisenstat, Slapnicar, Veselic, Drmac, "Computing the singular
 * value decomposition with high relative accuracy", Linear Algebra and its Applications 299 (1999). For other
 * matrices it is the usual SVD. Returns false when an entry is not finite. */
bool vi_singular_find(int rows, int columns, double a[][VI_MODES], vi_singular *singular);

#endif
