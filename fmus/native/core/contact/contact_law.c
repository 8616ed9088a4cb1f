#include "contact/contact_law.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* ---- ranges of parameters ---- */

#define RULE(field, words, least, most) {#field, words, least, most, offsetof(vi_contact_law, field)}
#define POSITIVE(field) RULE(field, "a finite number > 0", DBL_TRUE_MIN, DBL_MAX)
#define NOT_NEGATIVE(field) RULE(field, "a finite number >= 0", 0.0, DBL_MAX)
#define AT_LEAST_ONE(field) RULE(field, "a finite number >= 1", 1.0, DBL_MAX)
#define FRACTION(field) RULE(field, "0 <= r <= 1", 0.0, 1.0)

const vi_law_rule vi_impact_rules[] = {FRACTION(restitution), NOT_NEGATIVE(yield_velocity), {0}};
static const vi_law_rule of_stiffness[] = {POSITIVE(stiffness), {0}};
static const vi_law_rule of_damping[] = {POSITIVE(stiffness), NOT_NEGATIVE(damping), {0}};
static const vi_law_rule of_exponent[] = {POSITIVE(stiffness), NOT_NEGATIVE(damping), AT_LEAST_ONE(exponent), {0}};

/* ---- forces ---- */

static vi_contact_force linear_force(const vi_press *press, double penetration, double rate)
{
    return (vi_contact_force){press->stiffness * penetration + press->damping * rate, press->stiffness, press->damping};
}

/* The force of a power law with any exponent. */
static vi_contact_force power_force(const vi_press *press, double penetration, double rate)
{
    const double spring = press->stiffness * pow(penetration, press->exponent);
    const double drag = 1.0 + press->damping * rate;
    return (vi_contact_force){spring * drag, press->exponent * spring / penetration * drag, spring * press->damping};
}

/* The force of exponent 1.5 without damping: a square root is several times faster than a power. */
static vi_contact_force root_force(const vi_press *press, double penetration, double rate)
{
    const double root = sqrt(penetration);
    (void)rate;
    return (vi_contact_force){press->stiffness * penetration * root, 1.5 * press->stiffness * root, 0.0};
}

/* ---- the table ---- */

/* The FMUs' enumeration ContactLaw takes names, descriptions, kinds and numbers from this table when FMUs are built. A
 * row begins with its number, its name and its description. Files hold these numbers: never change one. */
const vi_law vi_laws[VI_MOST_LAWS] = {
    [0] = {.name = "none", .description = "no stop here"},
    [1] = {.name = "restitution",
           .description = "impact: velocity_after = -r * velocity_before, with r falling above yield_velocity if that is set",
           .stop = VI_RIGID_STOP,
           .rules = vi_impact_rules},
    [2] = {.name = "kelvin_voigt",
           .description = "yields: force = stiffness * penetration + damping * rate, never pulling",
           .stop = VI_YIELDING_STOP,
           .rules = of_damping,
           .press = VI_PRESS_LINEAR,
           .damped = true,
           .exponent = 1.0,
           .force = linear_force},
    [3] = {.name = "hertz",
           .description = "yields: force = stiffness * penetration^1.5",
           .stop = VI_YIELDING_STOP,
           .rules = of_stiffness,
           .press = VI_PRESS_POWER,
           .exponent = 1.5,
           .force = root_force},
    [4] = {.name = "hunt_crossley",
           .description = "yields: force = stiffness * penetration^exponent * (1 + damping * rate), never pulling",
           .stop = VI_YIELDING_STOP,
           .rules = of_exponent,
           .press = VI_PRESS_POWER,
           .damped = true,
           .force = power_force},
    [5] = {.name = "external",
           .description = "another FMU answers an impact with applied_restitution; needs an importer that handles events",
           .stop = VI_RIGID_STOP,
           .external = true},
    [6] = {.name = "external_force",
           .description = "yields: another FMU answers with applied_force, applied_stiffness and applied_damping",
           .stop = VI_YIELDING_STOP,
           .external = true},
    [7] = {.name = "pair",
           .description = "no stop, but a point that another body may hit: its importer gives applied_impulse or applied_force",
           .stop = VI_NO_STOP,
           .external = true},
};

/* ---- queries ---- */

bool vi_contact_law_exists(int64_t law)
{
    return (uint64_t)law < VI_MOST_LAWS && vi_laws[law].name != NULL;
}

int64_t vi_contact_law_number(const char *name)
{
    for (int64_t law = 0; law < VI_MOST_LAWS; ++law) {
        if (vi_laws[law].name != NULL && strcmp(vi_laws[law].name, name) == 0) {
            return law;
        }
    }
    return -1;
}

vi_contact_law vi_contact_law_none(void)
{
    return (vi_contact_law){.law = 0};
}

vi_contact_law vi_contact_law_rigid(double restitution)
{
    return (vi_contact_law){.law = 1, .restitution = restitution};
}

vi_contact_law vi_contact_law_asking(void)
{
    return (vi_contact_law){.law = 5};
}

bool vi_law_rule_holds(const vi_law_rule *rule, const vi_contact_law *law, double *value)
{
    memcpy(value, (const char *)law + rule->place, sizeof *value);
    return *value >= rule->least && *value <= rule->most;
}

double vi_contact_law_restitution(const vi_contact_law *law, double approach_velocity)
{
    if (law->yield_velocity > 0.0 && approach_velocity > law->yield_velocity) {
        return law->restitution / sqrt(sqrt(approach_velocity / law->yield_velocity));
    }
    return law->restitution;
}

vi_contact_force vi_contact_law_force(const vi_contact_law *law, double penetration, double rate)
{
    const vi_law *row = vi_law_of(law->law);
    const vi_press press = vi_law_press(row, law);
    return vi_law_force(row, &press, penetration, rate);
}
