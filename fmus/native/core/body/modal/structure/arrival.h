/* Contacts that arrive at their stops: resolved together, or left to the answers of other FMUs. */
#ifndef VIBROIMPACT_STRUCTURE_ARRIVAL_H
#define VIBROIMPACT_STRUCTURE_ARRIVAL_H

#include <stdbool.h>

#include "body/modal/state.h"

/* Treat external laws among the hit contacts: wait for their answers, or (FMI 2.0) note the time and fly through. */
bool vi_structure_ask(const vi_structure *s, const int hit[], bool stop_here);

/* Resolve the hit contacts: compliant stops begin to yield, rigid stops answer together. */
void vi_structure_resolve_hits(const vi_structure *s, const int hit[]);

/* Contact k has arrived at its stop, possibly with others: resolve it, wait for an answer, or pass (FMI 2.0). */
void vi_structure_meet(const vi_structure *s, int k, bool stop_here);

#endif
