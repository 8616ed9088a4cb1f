/* Joint impulses of the hit contacts, and chatter summed to its end. */
#ifndef VIBROIMPACT_STRUCTURE_IMPACT_H
#define VIBROIMPACT_STRUCTURE_IMPACT_H

#include "body/modal/state.h"

/* Apply joint impulses to all contacts that touch and approach; external laws use their answers if `answered`. The
 * impacts that they set off at this instant follow in rounds, fastest first. `cascade` of the state is set where rounds
 * are left. equations.md 3.5. */
void vi_structure_collide(const vi_structure *s, const int hit[VI_PORTS]);

/* Go on with the rounds that an event has left. */
void vi_structure_collide_on(const vi_structure *s);

/* Apply the given impulses once, each to its contact. A resting contact then leaves its stop, or hits it next. */
void vi_structure_take_impulses(const vi_structure *s);

/* Model exchange: the integrator brings contact k back to its stop while it still leaves, as its bounce is so low. From
 * now on bounces as low as this are summed. */
void vi_structure_end_bounce(const vi_structure *s, int k);

#endif
