/* The functions that vibroimpact.fmus.core calls for correlation sums. */
#ifndef VIBROIMPACT_DOOR_CORRELATION_H
#define VIBROIMPACT_DOOR_CORRELATION_H

#include <stddef.h>
#include <stdint.h>

/* Number of NaN needed behind the values, and number of tables in `joint`. */
size_t vi_door_correlation_padding(void);
size_t vi_door_correlation_tables(void);

/* vi_correlation_add, which adds to `joint`. The lowest radius must be on the ladder. Returns 0; 1: bad argument. */
int vi_door_correlation_add(const double value[], size_t count, size_t first, size_t last, size_t step, int embedding,
                            double lowest, int radii, uint64_t joint[]);

#endif
