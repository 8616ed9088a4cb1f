/* Complex modes of a body with classical damping, while one of its points is held in place or presses a linear stop.
 *
 * The coupling of the modes has rank one. The rates s are the zeros of 1/Z(s) + sum n_j^2 / (s^2 + D_j s + W_j). Here Z
 * = stiffness + damping s, and 1/Z is 0 for a held point. The vector of a rate is n_j / (s^2 + D_j s + W_j), for a
 * force of -1. Zeros are kept as distances from poles: vectors are exact even near a node. equations.md 3.4, 6.9
 */
#ifndef VIBROIMPACT_PRESSED_MODES_H
#define VIBROIMPACT_PRESSED_MODES_H

#include "modes/pressed_terms.h"

/* Find the modes of a body that rests on one contact, without coupling by its damping. False where they lose digits:
 * nearly equal rates, or modes that are overdamped or nearly critical. */
bool vi_pressed_modes_find(vi_pressed_modes *found, const vi_pressed_body *body);

#endif
