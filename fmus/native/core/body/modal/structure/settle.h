/* Contacts that touch, at the start of a step or after an event: each is hit, rests, yields or leaves. */
#ifndef VIBROIMPACT_STRUCTURE_SETTLE_H
#define VIBROIMPACT_STRUCTURE_SETTLE_H

#include "body/modal/state.h"

/* Settle all touching contacts after inputs or states have changed: each is hit, rests, yields or leaves. `stop_here`:
 * a hit contact with an external law waits for its answer; otherwise the body flies through. */
void vi_structure_settle(const vi_structure *s, bool stop_here);

#endif
