/* The moment of contact itself: impact law, chatter summed to its end, the start of a stick; and extremes. */
#ifndef VIBROIMPACT_IMPACT_H
#define VIBROIMPACT_IMPACT_H

#include "body/one_mass/body_state.h"

/* The body, on stop k (0-based), has this speed of approach (>= 0): apply the law with restitution r in [0, 1], and
 * let the body rest when the chatter that follows can be summed. equations.md 1.6, 3.1. */
void vi_body_impact(vi_body *body, int k, double approach, double restitution);

/* Rest on stop k; the stick begins `delay` seconds from now (the summed chatter), with that chatter's impulse, N s. */
void vi_body_stick(vi_body *body, int k, double delay, double tail_impulse);

/* Extend the record's extremes by all turning points of the segment up to `end`. */
void vi_body_follow_extrema(vi_body *body, const vi_segment *segment, double end);

#endif
