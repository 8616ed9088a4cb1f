/* The motion of a structure from the instant at which a power law begins to press.
 *
 * There d^exponent has no Taylor series in time. With an exponent of halves it has one in the square root r of time: d =
 * r^2 e(r) with e(0) the speed, so d^exponent = r^(2 exponent) e^exponent. One such segment takes the place of a dozen whose
 * lengths grow with the depth. */
#ifndef VIBROIMPACT_ENTRY_FLOW_H
#define VIBROIMPACT_ENTRY_FLOW_H

#include <stdbool.h>

#include "body/modal/coupled_flow.h"

/* Begin at depth 0 of contact k, which moves in, all others being free and the damping not coupling the modes. False where
 * twice the exponent is no whole number. */
bool vi_entry_begin(vi_drift *drift, const vi_structure_model *model, const vi_drift_start *start, int k,
                    double length);

#endif
