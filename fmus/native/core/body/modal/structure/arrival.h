/* Contacts that arrive at their stops: resolved together, or left to the answers of other FMUs. */
#ifndef VIBROIMPACT_STRUCTURE_ARRIVAL_H
#define VIBROIMPACT_STRUCTURE_ARRIVAL_H

#include <stdbool.h>

#include "body/modal/state.h"

/* External laws among the contacts that are hit: wait for their answers, or (FMI 2.0) note the time and fly through. */
bool vi_structure_ask(const vi_structure *s, const int hit[], bool stop_here);

/* Those that are hit: compliant stops begin to yield, rigid ones answer together. */
void vi_structure_resolve_hits(const vi_structure *s, const int hit[]);

/* Contact k has arrived at its stop (others may have, too): resolve it, or wait for an answer, or pass (FMI 2.0). */
void vi_structure_meet(const vi_structure *s, int k, bool stop_here);

#endif
