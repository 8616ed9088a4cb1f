/* Bodies between rigid stops of which one moves and leaves no room. equations.md 6.13 */
#ifndef VIBROIMPACT_JAM_H
#define VIBROIMPACT_JAM_H

#include "body/complaint.h"
#include "body/modal/state.h"

/* Do rigid contacts, of which one moves, close in on bodies that have no way out? jammed[k]: is contact k one of them? A
 * contact counts up to this clearance, relative to its displacements. */
bool vi_structure_jams(const vi_structure *s, double least, int jammed[VI_PORTS]);

/* Complain of such contacts where time stands still; false where there are none. */
bool vi_structure_jam_complains(const vi_structure *s, char message[VI_MESSAGE_LENGTH]);

#endif
