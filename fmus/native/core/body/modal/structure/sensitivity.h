/* Derivatives of a motion over parameters, since its start: the variational flow, through every event. equations.md 6.17
 *
 * A body without parameters has a NULL pointer in its vi_structure, which costs a test an event.
 */
#ifndef VIBROIMPACT_SENSITIVITY_H
#define VIBROIMPACT_SENSITIVITY_H

#include "body/modal/structure/parameter.h"

/* A segment begins here. */
void vi_sensitivity_begin(const vi_structure *s);

/* A segment of u seconds has ended; the motion is at its end, instant and contacts are those of its start. */
void vi_sensitivity_flow(const vi_structure *s, double u);

/* Contact k is about to meet its stop. */
void vi_sensitivity_meet(const vi_structure *s, int k);

/* These contacts are about to get these impulses, N s. */
void vi_sensitivity_impact(const vi_structure *s, const int hit[], const int in_play[], const double approach[],
                           const double impulse[]);

/* These contacts lose their speed by these impulses; contact k does, which comes to rest beside the held ones (NULL: by
 * impulses of rounding size). */
void vi_sensitivity_stop(const vi_structure *s, const int stopped[], const double impulse[]);
void vi_sensitivity_rest(const vi_structure *s, int k, const double impulse[]);

/* An output has now the instant and the speed of an impact of contact k, or of a touch-down. */
void vi_sensitivity_count(const vi_structure *s, int k, bool touch_down);

/* The events of this instant are over. */
void vi_sensitivity_end(const vi_structure *s);

#endif
