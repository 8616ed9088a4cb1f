/* Fast Fourier transforms of a power of two, in place. They use the four operations only: their bits are the same on
 * every machine.
 *
 * The forward transform leaves its frequencies in bit-reversed order, and the backward one takes them so: a convolution
 * needs no sorting.
 */
#ifndef VIBROIMPACT_TRANSFORM_H
#define VIBROIMPACT_TRANSFORM_H

/* Largest size of a transform. */
enum { VI_TRANSFORM_ROOM = 32768 };

/* cos and sin of pi j / half, 0 <= j < half, at places half + j, for each power of two `half`. */
typedef struct {
    int size; /* of the largest transform that the tables serve; 0 at first */
    double cosine[VI_TRANSFORM_ROOM], sine[VI_TRANSFORM_ROOM];
} vi_transform;

/* Make the tables of a transform of `size` numbers, a power of two from 4 to VI_TRANSFORM_ROOM. */
void vi_transform_prepare(vi_transform *transform, int size);

/* real + i imaginary becomes the sum over k of (real + i imaginary)[k] exp(-2 pi i j k / size), at place reversed(j). */
void vi_transform_forward(const vi_transform *transform, int size, double real[], double imaginary[]);

/* The inverse of the forward transform, times `size`. */
void vi_transform_backward(const vi_transform *transform, int size, double real[], double imaginary[]);

/* Place of frequency j: its bits in reverse order. */
int vi_transform_place(int size, int j);

#endif
