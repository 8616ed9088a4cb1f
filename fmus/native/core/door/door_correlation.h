/* The functions that vibroimpact.fmus.core calls for correlation sums. */
#ifndef VIBROIMPACT_DOOR_CORRELATION_H
#define VIBROIMPACT_DOOR_CORRELATION_H

#include <stddef.h>
#include <stdint.h>

/* How many NaN the values need behind them, and how many tables `joint` has. */
size_t vi_door_correlation_padding(void);
size_t vi_door_correlation_tables(void);

/* vi_correlation_add of correlation.h. The lowest radius must be one of the
 * ladder. `joint` is added to. Returns 0, or 1 for a bad argument. */
int vi_door_correlation_add(const double value[], size_t count, size_t first, size_t last, size_t step, int embedding,
                            double lowest, int radii, uint64_t joint[]);

#endif
