/* A body of many modes in contacts with power laws, by steps that the contacts set, not the fastest mode. */
#ifndef VIBROIMPACT_STRUCTURE_POWER_CONTACT_H
#define VIBROIMPACT_STRUCTURE_POWER_CONTACT_H

#include "body/modal/structure/events.h"

/* Follow the pressed contacts by steps without an event, of at most `length` seconds in all, and move the state.
 * Returns the time moved; 0 where no such step fits: the series then go on. */
double vi_structure_press_on(const vi_structure *s, const vi_situation *now, const vi_drift_start *state,
                             double length);

#endif
