/* Parts of the loop over coupled components, for steps that are tried: see coupling.h. */
#ifndef VIBROIMPACT_COUPLING_STEPS_H
#define VIBROIMPACT_COUPLING_STEPS_H

#include "door/coupling.h"

/* Result of a part of a step that went well. */
enum { VI_COUPLING_GO_ON = -1 };

/* Make calls; FAILED, with their place and status in the run. */
int vi_coupling_make(const vi_coupling_plan *plan, vi_coupling_run *r, const vi_coupling_calls *calls);

/* Save the states of all components, or restore the saved ones. */
int vi_coupling_save(const vi_coupling_plan *plan, vi_coupling_run *r);
int vi_coupling_restore(const vi_coupling_plan *plan, vi_coupling_run *r);

/* Step all components from `start` to `target`, or to the first event of any; `reached` is the end. */
int vi_coupling_step(const vi_coupling_plan *plan, vi_coupling_progress *p, vi_coupling_run *r);

#endif
