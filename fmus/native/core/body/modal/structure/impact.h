/* Joint impulses of the contacts that are hit, and chatter summed to its end. */
#ifndef VIBROIMPACT_STRUCTURE_IMPACT_H
#define VIBROIMPACT_STRUCTURE_IMPACT_H

#include "body/modal/state.h"

/* Joint impulses of all contacts that touch with an approach; answers of external laws are used where `answered`. */
void vi_structure_collide(const vi_structure *s, const int hit[VI_PORTS]);

/* Give the body the impulses that its contacts have been given, once. What rests on a stop leaves it, or hits it as the
 * next step begins. */
void vi_structure_take_impulses(const vi_structure *s);

/* Model exchange: the integrator brings contact k back to its stop while it still leaves it, so low is its bounce. The
 * bounces still to come are summed, and from now on all that are as low. */
void vi_structure_end_bounce(const vi_structure *s, int k);

#endif
