/* Wall time, by which a loop knows when to return to its caller. */
#ifndef VIBROIMPACT_SECONDS_H
#define VIBROIMPACT_SECONDS_H

#include <time.h>

static inline double vi_seconds_now(void)
{
    struct timespec now;
    return timespec_get(&now, TIME_UTC) != 0 ? (double)now.tv_sec + 1e-9 * (double)now.tv_nsec : 0.0;
}

/* Seconds since `then`; 0 if the clock has been set back. */
static inline double vi_seconds_since(double then)
{
    const double passed = vi_seconds_now() - then;
    return passed > 0.0 ? passed : 0.0;
}

#endif
