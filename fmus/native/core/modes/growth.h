/* Growth of motions by negative stiffness or damping: equations.md 1.9. */
#ifndef VIBROIMPACT_GROWTH_H
#define VIBROIMPACT_GROWTH_H

#include "motion/segment.h"
#include "sizes.h"

/* Rate above which no motion of the modes grows, 1/s; 0 where the energy of no motion grows. `coupling`: their damping
 * matrix, 1/s; NULL: each mode has its own damping. */
double vi_growth_of(int modes, const vi_mode mode[], const double coupling[][VI_MODES]);

#endif
