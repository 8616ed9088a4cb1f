/* What a stop answers. The same functions serve the bodies (fused) and the ImpactStop FMU (coupled): a stop only
 * evaluates its law, the body alone resolves the contact. */
#ifndef VIBROIMPACT_CONTACT_LAW_H
#define VIBROIMPACT_CONTACT_LAW_H

#include <stdbool.h>
#include <stdint.h>

/* The numbers are those of the enumeration ContactLaw; 2 to 4 are kept for the compliant laws. */
enum { VI_LAW_NONE = 0, VI_LAW_RESTITUTION = 1, VI_LAW_EXTERNAL = 5 };
enum { VI_SIDE_UPPER = 1, VI_SIDE_LOWER = 2 };

/* Parameters of a law at one stop. */
typedef struct {
    int64_t law;
    double restitution; /* 0 to 1 */
} vi_contact_law;

/* Coefficient of restitution for a speed of approach (m/s, >= 0). */
double vi_contact_law_restitution(const vi_contact_law *law, double approach_velocity);

/* Is this a law that a stop can evaluate by itself? */
bool vi_contact_law_known(int64_t law);

/* +1 for a stop above the motion, -1 for one below: displacements times this approach the stop as they grow. */
double vi_contact_direction(int64_t side);

#endif
