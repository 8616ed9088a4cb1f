/* The flow of the derivatives of a motion over a parameter, between two events. equations.md 6.17 */
#ifndef VIBROIMPACT_VARIATIONAL_FLOW_H
#define VIBROIMPACT_VARIATIONAL_FLOW_H

#include "body/modal/state.h"

/* Carry the derivatives over parameter i by u seconds from the present instant, along the motion from `before`. */
void vi_variational_flow(const vi_structure *s, int i, double u);

#endif
