/* Optional records along a motion: extremes of the observed point, energies, largest forces. */
#ifndef VIBROIMPACT_STRUCTURE_EXTREMES_H
#define VIBROIMPACT_STRUCTURE_EXTREMES_H

#include "body/modal/coupled_flow.h"
#include "body/modal/modal_flight.h"
#include "body/modal/state.h"

/* ---- energies, when they are followed ---- */

/* Longest flight for its energies, s; HUGE_VAL when energies are not followed. */
double vi_energies_reach(const vi_structure *s);
void vi_energies_of_flight(const vi_structure *s, const vi_flight *flight, const double held[], double u);
/* Contacts that are `still` do no work: the motion in their series is rounding. */
void vi_energies_of_drift(const vi_structure *s, const vi_drift *drift, const double held[], const int still[],
                          double u);
/* Take back the work of the loads over a drift from the displacements `q` that the holding stops have undone. A drift
 * of which more than half is undone was rounding and no motion. */
void vi_energies_of_rounding(const vi_structure *s, const vi_drift *drift, const double q[], const double held[],
                             double u);

/* ---- largest forces of contacts that yield ---- */

/* Largest forces of recorded contacts over the first u seconds of a drift. Thin contacts have no force there. */
void vi_peaks_of_drift(const vi_structure *s, const vi_drift *drift, double u);

/* ---- extremes of the observed point and of the further ones ---- */

/* Extend the extremes to the present state. */
void vi_extremes_here(const vi_structure *s);
void vi_extremes_of_flight(const vi_structure *s, const vi_flight *flight, double u);
void vi_extremes_of_drift(const vi_structure *s, const vi_drift *drift, double u);

#endif
