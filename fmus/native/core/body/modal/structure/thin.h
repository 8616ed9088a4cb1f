/* Thin contacts: a power law so little pressed in that its force acts as an impulse. */
#ifndef VIBROIMPACT_STRUCTURE_THIN_H
#define VIBROIMPACT_STRUCTURE_THIN_H

#include "body/modal/coupled_flow.h"
#include "body/modal/state.h"

/* How long the force of power law k may act as that of a penetration at constant rate, s: as long as the tolerance
 * allows, and at least until the penetration has changed by a rounding of the displacement. The penetration may begin
 * without speed, or where damping leaves no force. Below `least` the time is of no interest, and not sought further. */
double vi_thin_time(const vi_structure *s, int k, double rate, const double acceleration[], double least);

/* Give the impulse of a thin contact over u seconds of constant rate, to the state at the end. */
void vi_thin_impulse(const vi_structure *s, int k, double depth, double rate, double u);

/* What thin contacts at these depths, which the series leave out, add to the force of held contact k after u seconds;
 * *size: the sum of the moduli. */
double vi_thin_part(const vi_structure *s, const vi_drift *drift, const int thin[], const double at[], int k, double u,
                    double *size);

#endif
