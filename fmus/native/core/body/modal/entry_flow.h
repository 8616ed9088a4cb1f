/* The motion of a structure from the instant at which a power law begins to press.
 *
 * At this instant d^exponent has no Taylor series in time. It has one in r = sqrt(time) if 2 exponent is a whole
 * number: d = r^2 e(r) with e(0) the speed, so d^exponent = r^(2 exponent) e^exponent. One such segment replaces a
 * dozen segments whose lengths grow with the depth.
 */
#ifndef VIBROIMPACT_ENTRY_FLOW_H
#define VIBROIMPACT_ENTRY_FLOW_H

#include <stdbool.h>

#include "body/modal/coupled_flow.h"

/* Begin at depth 0 of contact k, which moves in. All other contacts must be free, and the damping must not couple the
 * modes. Returns false unless twice the exponent is a whole number below VI_ORDER / 2. */
bool vi_entry_begin(vi_drift *drift, const vi_structure_model *model, const vi_drift_start *start, int k,
                    double length);

#endif
