/* Outputs of a contact port about its impacts, sticks and releases, for all bodies. */
#ifndef VIBROIMPACT_CONTACT_EVENTS_H
#define VIBROIMPACT_CONTACT_EVENTS_H

#include "body/record.h"
#include "contact/contact.h"
#include "motion/clock.h"

/* Contact `number` (1-based) is hit now: count the impact, and write its row. impulse: N s. */
void vi_contact_hit(vi_contact *contact, vi_record *record, const vi_clock *clock, vi_instant now, int number,
                    double approach, double impulse, double restitution);

/* The contact sticks from `delay` seconds after now. */
void vi_contact_stick(vi_contact *contact, const vi_clock *clock, vi_instant now, double delay);

/* The contact is released now. */
void vi_contact_lift(vi_contact *contact, const vi_clock *clock, vi_instant now);

#endif
