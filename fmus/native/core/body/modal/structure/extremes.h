/* What is recorded along a motion when it is asked for: extremes of the observed point, energies. */
#ifndef VIBROIMPACT_STRUCTURE_EXTREMES_H
#define VIBROIMPACT_STRUCTURE_EXTREMES_H

#include "body/modal/coupled_flow.h"
#include "body/modal/modal_flight.h"
#include "body/modal/state.h"

/* ---- energies, when they are followed ---- */

/* How long a flight may be for its energies, s: HUGE_VAL when they are not followed. */
double vi_energies_reach(const vi_structure *s);
void vi_energies_of_flight(const vi_structure *s, const vi_flight *flight, const double held[], double u);
/* Contacts that are `still` do no work: what their series say of their motion is rounding. */
void vi_energies_of_drift(const vi_structure *s, const vi_drift *drift, const double held[], const int still[],
                          double u);
/* A drift from the displacements `q` that rounding and the stops that hold have undone, more than half of it, was no
 * motion: the loads did no work over what is undone. */
void vi_energies_of_rounding(const vi_structure *s, const vi_drift *drift, const double q[], const double held[],
                             double u);

/* ---- largest forces of contacts that yield ---- */

/* Of the contacts whose impacts are recorded, over the first u seconds of a drift; its thin contacts have no force there. */
void vi_peaks_of_drift(const vi_structure *s, const vi_drift *drift, double u);

/* ---- extremes of the observed point ---- */

void vi_extremes_of_flight(const vi_structure *s, const vi_flight *flight, double u);
void vi_extremes_of_drift(const vi_structure *s, const vi_drift *drift, double u);

#endif
