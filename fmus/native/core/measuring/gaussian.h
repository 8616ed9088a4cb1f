/* Gaussian numbers as a function of seed, channel and index. There is no state, so no cut of the time and no number of
 * workers changes them. They use only integers, the four operations and the square root, which IEEE 754 rounds in one
 * way. So their bits are the same on every machine, with any mathematical library. */
#ifndef VIBROIMPACT_GAUSSIAN_H
#define VIBROIMPACT_GAUSSIAN_H

#include <stdint.h>

/* Number `index` of a channel under a seed: mean 0, variance 1, |number| < 8.4. Numbers of different channels, seeds
 * and indices are independent. */
double vi_gaussian(uint64_t seed, uint64_t channel, uint64_t index);

/* Two numbers of one counter, as independent as all others; the first one is vi_gaussian of the same arguments. */
void vi_gaussian_pair(uint64_t seed, uint64_t channel, uint64_t index, double pair[2]);

/* The Gaussian number below which the probability is (j + 1/2) / 2^53 + 1/2; -2^52 <= j < 2^52. */
double vi_gaussian_quantile(int64_t j);

#endif
