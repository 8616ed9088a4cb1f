/* Singular values and vectors, each to high relative accuracy for matrices without cycles. */
#ifndef VIBROIMPACT_SINGULAR_H
#define VIBROIMPACT_SINGULAR_H

#include <stdbool.h>

#include "sizes.h"

/* Most rows of a matrix: the springs of a chain, or the modes of a body and its pressed stops. */
enum { VI_ROWS = VI_MODES + VI_PORTS };

typedef struct {
    int rank;                                /* number of values above 0; exact for a matrix without cycles */
    double value[VI_MODES];                  /* values above 0, ascending */
    double left[VI_MODES][VI_ROWS];     /* left[k]: unit vector of value k, one component for each row */
    double right[VI_MODES][VI_MODES];        /* right[k]: unit vector, one component for each column */
} vi_singular;

/* Decompose the rows x columns matrix a[row][column], at most VI_ROWS x VI_MODES, which is overwritten. False when an
 * entry is not finite.
 *
 * A matrix has no cycles if its entries, as edges between rows and columns, form no closed path. The springs and the
 * masses of a chain form none. Then the error of every singular value is a few roundings relative to this value,
 * however many decades the entries span. For other matrices it is the usual SVD. Demmel, Gu, Eisenstat, Slapnicar,
 * Veselic, Drmac, "Computing the singular value decomposition with high relative accuracy", Linear Algebra and its
 * Applications 299 (1999).
 */
bool vi_singular_find(int rows, int columns, double a[][VI_MODES], vi_singular *singular);

#endif
