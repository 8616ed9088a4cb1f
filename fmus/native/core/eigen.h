/* Eigenvalues and eigenvectors of a real symmetric matrix. */
#ifndef VIBROIMPACT_EIGEN_H
#define VIBROIMPACT_EIGEN_H

#include <stdbool.h>

/* Of the symmetric n x n matrix a (row-major, destroyed): eigenvalues ascending, and orthonormal eigenvectors in the
 * columns of vectors (row-major: component i of vector j is vectors[i * n + j]). Each vector's sign makes its component
 * of largest modulus positive. Returns false when it does not converge (only for entries that are not finite). */
bool vi_eigen_symmetric(int n, double a[], double values[], double vectors[]);

#endif
