#include "door/log_ring.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

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
    if (environment != NULL && message != NULL) {
        (void)snprintf(next_line(environment), VI_LOG_LENGTH, "%s", message);
    }
}

void vi_log_ring_fmi2(void *environment, const char *instance, int status, const char *category, const char *message,
                      ...)
{
    (void)instance;
    (void)status;
    (void)category;
    if (environment == NULL || message == NULL) {
        return;
    }
    va_list arguments;
    va_start(arguments, message);
    (void)vsnprintf(next_line(environment), VI_LOG_LENGTH, message, arguments);
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
