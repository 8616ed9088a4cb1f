/* Thin contacts: power laws with so little penetration that their force acts as an impulse. */
#ifndef VIBROIMPACT_STRUCTURE_THIN_H
#define VIBROIMPACT_STRUCTURE_THIN_H

#include <stdbool.h>

#include "body/modal/coupled_flow.h"
#include "body/modal/state.h"

/* Time for which the force of power law k may act as that of a penetration at constant rate, s. The tolerance limits it
 * from above. It lasts at least until the penetration has changed by a rounding of the displacement. The penetration
 * may begin without speed, or where damping leaves no force. Times below `least` are not refined further. */
double vi_thin_time(const vi_structure *s, int k, double rate, const double acceleration[], double least);

/* Does the force of contact k, which moves out, surely last for `time`? A Hunt-Crossley force ends, at any depth, where
 * 1 + damping d' falls to 0. */
bool vi_thin_lasts(const vi_structure *s, int k, double rate, const double acceleration[], double time);

/* Add the impulse of a thin contact over u seconds of constant rate to the state at the end. */
void vi_thin_impulse(const vi_structure *s, int k, double depth, double rate, double u);

/* Part of thin contacts, which the series leave out, in the force of held contact k after u seconds. at: their depths;
 * *size: the sum of the moduli. */
double vi_thin_part(const vi_structure *s, const vi_drift *drift, const int thin[], const double at[], int k, double u,
                    double *size);

#endif
