/* Partial derivatives of a body at one instant. equations.md 6.15 */
#ifndef VIBROIMPACT_BODY_DERIVATIVES_H
#define VIBROIMPACT_BODY_DERIVATIVES_H

#include "component.h"

extern const vi_partial_derivatives vi_body_derivatives;

#endif
