/* Time as whole forcing periods and a rest, so that the phase of the 10^6th period is as exact as the first.
 *
 * The origin is the last instant of forcing phase 0 at or before time 0; hence phase = angular_frequency * rest. After
 * a change of frequency the origin is an instant at which a force of the present frequency would have phase 0. The
 * period 2 pi / angular_frequency is kept to 32 digits (double + double). Unforced bodies count in a power of two near
 * their natural period, so conversions are exact.
 */
#ifndef VIBROIMPACT_CLOCK_H
#define VIBROIMPACT_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    double angular_frequency; /* rad/s; 0 when unforced */
    double period, period_low; /* s; their sum is the period */
    double origin, origin_low; /* time from the clock's origin to time 0, s */
} vi_clock;

typedef struct {
    int64_t periods;
    double rest;     /* s, 0 <= rest < period */
    double rest_low; /* rounding of `rest`: keeps short flights in a long period exact */
} vi_instant;

/* Number of events in a row at one instant. */
typedef struct {
    vi_instant instant;
    int64_t events;
} vi_standstill;

/* Number of events at one instant from which on time counts as standing still; eight contacts need some tens at
 * most. */
enum { VI_MOST_EVENTS = 1000 };

/* Events in a row that have left the time at `now`. */
int64_t vi_clock_events_here(const vi_standstill *standstill, vi_instant now);

/* Count an event at `now`; true once VI_MOST_EVENTS in a row have left the time unchanged. */
bool vi_clock_stands(vi_standstill *standstill, vi_instant now);

/* Start a clock for a force of this angular frequency (rad/s, >= 0) and phase (rad) at time 0. `natural` (rad/s) serves
 * when angular_frequency is 0. Returns false when the period is not a finite positive number of seconds. */
bool vi_clock_start(vi_clock *clock, double angular_frequency, double phase, double natural);

/* Can the clock go on at this angular frequency, rad/s, from `now`? It must be 0 if and only if it was 0. */
bool vi_clock_can_retune(const vi_clock *clock, double angular_frequency, vi_instant now);

/* Change the angular frequency to a value that vi_clock_can_retune allows, from *now on. Time, forcing phase and count
 * of periods stay. past[]: instants before *now, which keep their times. */
void vi_clock_retune(vi_clock *clock, double angular_frequency, vi_instant *now, vi_instant *const past[], int count);

/* The instant of time = high + low, s. An instant closer to a period's start than the rounding of this time, or of
 * the phase at time 0, is moved to that start. Returns false beyond 2^53 periods. */
bool vi_clock_instant(const vi_clock *clock, double high, double low, vi_instant *instant);

/* Time of an instant, s, rounded once. */
double vi_clock_time(const vi_clock *clock, vi_instant instant);

/* Time of an instant to twice the digits: the sum of the returned number and *low, s. */
double vi_clock_time_twofold(const vi_clock *clock, vi_instant instant, double *low);

/* Is instant `a` before `b`? */
static inline bool vi_clock_is_before(vi_instant a, vi_instant b)
{
    return a.periods < b.periods || (a.periods == b.periods && (b.rest - a.rest) + (b.rest_low - a.rest_low) > 0.0);
}

/* Seconds from `a` to `b`. */
double vi_clock_elapsed(const vi_clock *clock, vi_instant a, vi_instant b);

/* Seconds from `a` to `b` to twice the digits: the sum of the returned number and *low. */
double vi_clock_elapsed_twofold(const vi_clock *clock, vi_instant a, vi_instant b, double *low);

/* Seconds from `instant` to the end of its period. */
double vi_clock_to_period_end(const vi_clock *clock, vi_instant instant);

/* `instant` moved by `seconds` >= 0. */
vi_instant vi_clock_after(const vi_clock *clock, vi_instant instant, double seconds);

/* Forcing phase, rad, in [0, 2 pi); NaN when unforced. */
double vi_clock_phase(const vi_clock *clock, vi_instant instant);

#endif
