/* The response of a body to loads while one of its points is held in place or presses a linear stop. */
#ifndef VIBROIMPACT_PRESSED_RESPONSE_H
#define VIBROIMPACT_PRESSED_RESPONSE_H

#include "modes/pressed_modes.h"

/* The response q to loads of the form Re(load e^(s t)) with a force F. It solves (s^2 + D s + W) q + n F = load and n.q
 * - F/Z = offset. The mode nearest to resonance is solved last, so that only a double resonance costs digits. */
void vi_pressed_response(const vi_pressed_body *body, vi_complex s, const vi_complex load[], vi_complex offset,
                         vi_complex q[], vi_complex *force);

#endif
