#include "body/contact_events.h"

#include <math.h>

void vi_contact_hit(vi_contact *contact, vi_record *record, const vi_clock *clock, vi_instant now, int number,
                    double approach, double impulse, double restitution)
{
    contact->count += 1;
    contact->last_time = vi_clock_time(clock, now);
    contact->last_phase = vi_clock_phase(clock, now);
    contact->last_velocity = approach;
    contact->impulse = impulse;
    contact->total_impulse += impulse;
    vi_record_impact(record, contact->last_time, contact->last_phase, approach, impulse, number, restitution);
}

void vi_contact_stick(vi_contact *contact, const vi_clock *clock, vi_instant now, double delay)
{
    contact->stuck = 1;
    contact->earlier = 0;
    contact->stick_start = vi_clock_time(clock, vi_clock_after(clock, now, delay));
    contact->stick_end = NAN;
}

void vi_contact_lift(vi_contact *contact, const vi_clock *clock, vi_instant now)
{
    contact->stick_end = vi_clock_time(clock, now);
    contact->stick_start = fmin(contact->stick_start, contact->stick_end); /* it lifted during its chatter */
    contact->stuck = 0;
}
