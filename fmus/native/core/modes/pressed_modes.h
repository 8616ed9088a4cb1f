/* Complex modes of a body whose damping is classical, while one point of it is held in place or presses a linear stop.
 *
 * What couples the modes is of rank one: the rates s are the zeros of 1/Z(s) + sum n_j^2 / (s^2 + D_j s + W_j), with Z =
 * stiffness + damping s (none where the point is held), and the vector of each is n_j / (s^2 + D_j s + W_j) for a force of
 * -1. Each zero is kept as its distance from a pole, so that vectors are exact for points close to a node too.
 * equations.md 3.4, 6.9 */
#ifndef VIBROIMPACT_PRESSED_MODES_H
#define VIBROIMPACT_PRESSED_MODES_H

#include "modes/pressed_terms.h"

/* Of a body that rests on one contact, without coupling by its damping. False where they cannot be told to the last
 * digits: nearly equal rates, modes that are overdamped or nearly critical. */
bool vi_pressed_modes_find(vi_pressed_modes *found, const vi_pressed_body *body);

#endif
