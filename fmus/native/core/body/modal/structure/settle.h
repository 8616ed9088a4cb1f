/* Contacts that touch, at the start of a step or after something has happened: hit, rest, yield or leave. */
#ifndef VIBROIMPACT_STRUCTURE_SETTLE_H
#define VIBROIMPACT_STRUCTURE_SETTLE_H

#include "body/modal/state.h"

/* What the contacts that touch do now, after inputs or states changed: hit, rest, yield or leave. `stop_here`: one with an
 * external law that is hit waits for its answer; else the body flies through. */
void vi_structure_settle(const vi_structure *s, bool stop_here);

#endif
