/* The response of a body to loads while one point of it is held in place or presses a linear stop. */
#ifndef VIBROIMPACT_PRESSED_RESPONSE_H
#define VIBROIMPACT_PRESSED_RESPONSE_H

#include "modes/pressed_modes.h"

/* The response q to loads in the form Re(load e^(s t)) with a force F: (s^2 + D s + W) q + n F = load and n.q - F/Z
 * = offset. The mode that is nearest to resonance is told last, so that none but a double resonance costs digits. */
void vi_pressed_response(const vi_pressed_body *body, vi_complex s, const vi_complex load[], vi_complex offset,
                         vi_complex q[], vi_complex *force);

#endif
