#include "door/log_ring.h"

#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>

enum { RINGS_OF_BLOCK = 64 };

/* The rings of this process. Blocks are never freed: a component may log from a thread of its own at any time. */
typedef struct block {
    _Atomic(vi_log_ring *) rings[RINGS_OF_BLOCK];
    _Atomic(struct block *) next;
} block;

static block first;

/* Return the block after another one, made if there is none; NULL without memory. */
static block *following(block *here)
{
    block *next = atomic_load(&here->next);
    if (next != NULL) {
        return next;
    }
    block *made = calloc(1, sizeof *made);
    if (made != NULL && !atomic_compare_exchange_strong(&here->next, &next, made)) {
        free(made);
        return next;
    }
    return made;
}

/* Change the first place that holds a ring (or NULL), and return whether there was one. */
static int replace(block *here, vi_log_ring *old, vi_log_ring *new)
{
    for (size_t i = 0; i < RINGS_OF_BLOCK; i++) {
        vi_log_ring *expected = old;
        if (atomic_compare_exchange_strong(&here->rings[i], &expected, new)) {
            return 1;
        }
    }
    return 0;
}

int vi_log_ring_add(vi_log_ring *ring)
{
    for (block *here = &first; here != NULL; here = following(here)) {
        if (replace(here, NULL, ring)) {
            return 0;
        }
    }
    return -1;
}

void vi_log_ring_remove(vi_log_ring *ring)
{
    for (block *here = &first; here != NULL; here = atomic_load(&here->next)) {
        if (replace(here, ring, NULL)) {
            return;
        }
    }
}

/* Return the ring that an environment is, else the only ring of this process, else NULL.
 *
 * Some FMUs pass a pointer of their own in place of the environment that they were given.
 */
static vi_log_ring *ring_of(const void *environment)
{
    vi_log_ring *only = NULL;
    int count = 0;
    for (block *here = &first; here != NULL; here = atomic_load(&here->next)) {
        for (size_t i = 0; i < RINGS_OF_BLOCK; i++) {
            vi_log_ring *ring = atomic_load_explicit(&here->rings[i], memory_order_relaxed);
            if (ring == NULL) {
                continue;
            }
            if (ring == environment) {
                return ring;
            }
            only = ring;
            count += 1;
        }
    }
    return count == 1 ? only : NULL;
}

static char *next_line(vi_log_ring *ring)
{
    char *line = ring->lines[ring->count % VI_LOG_LINES];
    ring->count += 1;
    return line;
}

void vi_log_ring_fmi3(void *environment, int status, const char *category, const char *message)
{
    (void)status;
    (void)category;
    vi_log_ring *ring = ring_of(environment);
    if (ring != NULL && message != NULL) {
        (void)snprintf(next_line(ring), VI_LOG_LENGTH, "%s", message);
    }
}

void vi_log_ring_fmi2(void *environment, const char *instance, int status, const char *category, const char *message,
                      ...)
{
    (void)instance;
    (void)status;
    (void)category;
    vi_log_ring *ring = ring_of(environment);
    if (ring == NULL || message == NULL) {
        return;
    }
    va_list arguments;
    va_start(arguments, message);
    (void)vsnprintf(next_line(ring), VI_LOG_LENGTH, message, arguments);
    va_end(arguments);
}

void *vi_log_ring_allocate(size_t count, size_t size)
{
    return calloc(count, size);
}

void vi_log_ring_free(void *memory)
{
    free(memory);
}

void vi_log_ring_update(void *environment, double time, bool wants_values, bool gives_values, bool is_final,
                        bool can_return_early, bool *return_early, double *return_time)
{
    (void)environment, (void)wants_values, (void)gives_values, (void)is_final, (void)can_return_early;
    if (return_early != NULL) {
        *return_early = false;
    }
    if (return_time != NULL) {
        *return_time = time;
    }
}
