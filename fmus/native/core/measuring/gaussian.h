/* Gaussian numbers that depend on nothing but who asks for which: no state, so that no cut of the time and no worker
 * changes them. By integers, the four operations and the root alone, which IEEE 754 rounds in one way: the same bits on
 * every machine, whatever its mathematical library. */
#ifndef VIBROIMPACT_GAUSSIAN_H
#define VIBROIMPACT_GAUSSIAN_H

#include <stdint.h>

/* Number `index` of a channel under a seed: mean 0, variance 1, |number| < 8.4. Any channel, seed and index are
 * independent of any other. */
double vi_gaussian(uint64_t seed, uint64_t channel, uint64_t index);

/* The Gaussian number of which (j + 1/2) / 2^53 + 1/2 is the probability to be below; -2^52 <= j < 2^52. */
double vi_gaussian_quantile(int64_t j);

#endif
