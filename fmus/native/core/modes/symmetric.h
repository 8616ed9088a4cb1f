/* Eigenvalues and eigenvectors of complex symmetric matrices. */
#ifndef VIBROIMPACT_SYMMETRIC_H
#define VIBROIMPACT_SYMMETRIC_H

#include <stdbool.h>

#include "motion/complex.h"
#include "sizes.h"

enum { VI_STATES = 2 * VI_MODES };

/* Decompose the n x n matrix a = a' (transposed, not conjugated), which is overwritten. Afterwards its diagonal holds
 * the eigenvalues, and vector[k] is the k-th vector, with vector[k].vector[l] = 1 for k = l and 0 otherwise.
 *
 * The method is Jacobi's rotations by complex angles: J. Wilkinson, "The algebraic eigenvalue problem", 1965, for real
 * ones; P. Anderson, G. Loizou, "A Jacobi type method for complex symmetric matrices", Numerische Mathematik 25 (1976).
 * Vectors of graded matrices keep their small components, and equal eigenvalues do no harm. Returns false where a
 * vector is orthogonal to itself, or nearly so (critical damping), or the sweeps do not end.
 */
bool vi_symmetric_find(int n, vi_complex a[][VI_STATES], vi_complex vector[][VI_STATES]);

#endif
