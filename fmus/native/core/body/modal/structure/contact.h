/* Events of one contact: sticking, release, and compliant stops from touch-down to separation. */
#ifndef VIBROIMPACT_STRUCTURE_CONTACT_H
#define VIBROIMPACT_STRUCTURE_CONTACT_H

#include <stdbool.h>

#include "body/modal/state.h"

/* Contact k sticks from `delay` seconds after now, at the end of a chatter with this impulse, N s. On release it leaves
 * as `leaving` of the state says. */
void vi_structure_rest(const vi_structure *s, int k, double delay, double tail_impulse);
void vi_structure_release(const vi_structure *s, int k, int leaving);

/* A recording begins. Contacts that go on began before it, unless the motion begins here too. */
void vi_structure_begin_recording(const vi_structure *s);

/* A period ends: count the contacts that have begun in it, if they are known to be impacts. */
void vi_structure_count_contacts(const vi_structure *s);

/* Does a stick, or a contact with a stop that yields, go on at contact k and belong to the present recording? */
bool vi_structure_is_open(const vi_structure *s, int k);

/* A compliant stop begins to be pressed in; its contact ends. A contact may recede before the surface has come back. */
void vi_structure_touch_down(const vi_structure *s, int k);
void vi_structure_separate(const vi_structure *s, int k, bool receding);

/* A receding contact meets its surface. It presses again, or moves out too fast: the surface follows without force. */
void vi_structure_return(const vi_structure *s, int k);

/* A step begins: contacts with other FMUs' stops begin where the applied force is > 0. A start that leaves the stop
 * without force begins no contact. */
void vi_structure_meet_forces(const vi_structure *s);

/* Does the surface of a receding compliant stop still lag behind, on its way back to rest? */
bool vi_structure_surface_lags(const vi_structure *s, int k);

/* Does contact k, which is free, meet its stop at this instant, within rounding? */
bool vi_structure_meets_now(const vi_structure *s, int k);

/* Put contact k on its stop to the last bit. */
void vi_structure_put_on_stop(const vi_structure *s, int k);

#endif
