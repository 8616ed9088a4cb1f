/* The last lines logged by a component, in memory given by the importer (shared memory survives a crash).
 *
 * A component may log without end, so the ring allocates no memory and never calls Python. Python cannot receive FMI
 * 2.0's logger, which is variadic.
 */
#ifndef VIBROIMPACT_LOG_RING_H
#define VIBROIMPACT_LOG_RING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "door/door.h"

enum { VI_LOG_LINES = 20, VI_LOG_LENGTH = 480 }; /* lines kept; characters of a line with its end */

typedef struct {
    uint64_t count; /* number of lines logged so far; line i is in lines[i % VI_LOG_LINES] */
    char lines[VI_LOG_LINES][VI_LOG_LENGTH];
} vi_log_ring;

/* Register a ring before a component gets it as environment; returns 0, or -1 without memory. */
VI_DOOR int vi_log_ring_add(vi_log_ring *ring);

/* Forget a ring before its memory is freed; later lines for it are dropped. */
VI_DOOR void vi_log_ring_remove(vi_log_ring *ring);

/* fmi3LogMessageCallback, with a registered ring as instance environment.
 *
 * A line with any other environment goes into the only ring of the process. It is dropped if there are more.
 */
VI_DOOR void vi_log_ring_fmi3(void *environment, int status, const char *category, const char *message);

/* fmi2CallbackLogger, with a registered ring as component environment; others are treated likewise. */
VI_DOOR void vi_log_ring_fmi2(void *environment, const char *instance, int status, const char *category, const char *message,
                              ...);

/* fmi2CallbackAllocateMemory and fmi2CallbackFreeMemory. */
VI_DOOR void *vi_log_ring_allocate(size_t count, size_t size);
VI_DOOR void vi_log_ring_free(void *memory);

/* Intermediate update of FMI 3.0: values are neither set nor read there, and the step goes on to its end. */
VI_DOOR void vi_log_ring_update(void *environment, double time, bool wants_values, bool gives_values, bool is_final,
                                bool can_return_early, bool *return_early, double *return_time);

#endif
