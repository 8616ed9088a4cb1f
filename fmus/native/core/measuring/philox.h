/* Philox4x32-10 of Salmon, Moraes, Dror and Shaw, Parallel random numbers: as easy as 1, 2, 3, SC11 (2011). */
#ifndef VIBROIMPACT_PHILOX_H
#define VIBROIMPACT_PHILOX_H

#include <stdint.h>

/* Random bits as a function of a counter and a key only; they replace the counter. */
void vi_philox(uint32_t counter[4], uint32_t key0, uint32_t key1);

#endif
