#include "body/landing.h"

/* Time between a step's end and a contact, s, in units of 1 + |time|; at most this, both are one instant. */
static const double LANDING = 1e-13;
/* Longest segment, in periods; more than one, so that a flight of one period is not cut in two. */
static const double LONGEST_SEGMENT = 1.5;

double vi_segment_length(const vi_clock *clock, vi_instant now, vi_instant target, bool periods, vi_ending *ending)
{
    const double remaining = vi_clock_elapsed(clock, now, target);
    const double to_period = vi_clock_to_period_end(clock, now);
    if (periods && to_period <= remaining) {
        *ending = VI_ENDS_AT_PERIOD;
        return to_period;
    }
    const double longest = LONGEST_SEGMENT * clock->period;
    *ending = remaining <= longest ? VI_ENDS_AT_TARGET : VI_ENDS_ANYWHERE;
    return vi_min(remaining, longest);
}

vi_ending vi_ending_at(vi_ending ending, double u, double length, double room)
{
    const bool past = ending == VI_ENDS_AT_PERIOD ? u >= length : u > length + room;
    return past ? ending : VI_ENDS_ANYWHERE;
}

double vi_landing_room(double time)
{
    return LANDING * (1.0 + fabs(time));
}
