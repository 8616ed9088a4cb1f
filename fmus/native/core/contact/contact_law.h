/* Contact laws: the impulse or force with which a stop answers. The same functions serve the bodies (fused) and the
 * ImpactStop FMU (coupled). A stop only evaluates its law; the body resolves the contact.
 *
 * All laws are rows of one table. No other C file names a law: they ask for the kind of stop and the form of its force.
 */
#ifndef VIBROIMPACT_CONTACT_LAW_H
#define VIBROIMPACT_CONTACT_LAW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "contact/press.h"

enum { VI_SIDE_UPPER = 1, VI_SIDE_LOWER = 2 };

/* Parameters of a law at one stop. */
typedef struct {
    int64_t law;           /* number of its row */
    double restitution;    /* 0 to 1, below the yield velocity */
    double yield_velocity; /* speed above which restitution falls as (V / it)^(-1/4), m/s; 0: constant */
    double stiffness;      /* N/m; of a power law N/m^exponent */
    double damping;        /* N s/m; of a power law chi of F = K d^n (1 + chi d'), s/m */
    double exponent;       /* only of a law whose exponent is a parameter */
} vi_contact_law;

/* The force of a compliant stop and its slopes, at one penetration and rate of penetration. */
typedef struct {
    double force;     /* N, >= 0: a stop does not pull */
    double stiffness; /* its slope over penetration, N/m */
    double damping;   /* its slope over the rate, N s/m */
} vi_contact_force;

/* Range of one parameter of a law. */
typedef struct {
    const char *parameter; /* NULL ends an array of rules */
    const char *expected;  /* in words */
    double least, most;
    size_t place; /* offset in vi_contact_law */
} vi_law_rule;

/* Kind of stop of a law at a contact port. */
typedef enum {
    VI_NO_STOP = 0,
    VI_RIGID_STOP = 1,   /* it answers with an impulse */
    VI_YIELDING_STOP = 2 /* it answers with a force */
} vi_stop_kind;

/* A law: a row of the table, from which descriptions of FMUs and scenes are made too. */
typedef struct {
    const char *name; /* NULL: no law has this number */
    const char *description;
    vi_stop_kind stop;
    bool external; /* the importer gives the answer, or hits the point */
    const vi_law_rule *rules;
    /* only of a law that yields and is evaluated here: the form of its force, whether it has damping, its exponent (0:
     * a parameter). `force` holds for penetration > 0; pulling forces are cut later. */
    vi_press_kind press;
    bool damped;
    double exponent;
    vi_contact_force (*force)(const vi_press *press, double penetration, double rate);
} vi_law;

/* All numbers are below this; 0 is the law of an unused port. */
enum { VI_MOST_LAWS = 32 }; /* a power of 2 */
extern const vi_law vi_laws[VI_MOST_LAWS];

/* Ranges of the parameters of a stop that answers with an impulse. */
extern const vi_law_rule vi_impact_rules[];

/* The law of a number. A component refuses a number without a law when it starts; until then any row will do. */
static inline const vi_law *vi_law_of(int64_t number)
{
    return &vi_laws[(uint64_t)number % VI_MOST_LAWS];
}

/* Is there a law of this number? */
bool vi_contact_law_exists(int64_t law);

/* Number of the law of this name; -1: no such law. */
int64_t vi_contact_law_number(const char *name);

/* Laws of a port without a stop; with a rigid stop; with a stop whose answer the importer gives. */
vi_contact_law vi_contact_law_none(void);
vi_contact_law vi_contact_law_rigid(double restitution);
vi_contact_law vi_contact_law_asking(void);

/* Is the parameter finite and in its range? *value is set to the parameter. */
bool vi_law_rule_holds(const vi_law_rule *rule, const vi_contact_law *law, double *value);

/* Coefficient of restitution for a speed of approach (m/s, >= 0). */
double vi_contact_law_restitution(const vi_contact_law *law, double approach_velocity);

/* Force of a compliant law; all zero without penetration (m, > 0) or where it would pull. equations.md 6.9, 6.10 */
vi_contact_force vi_contact_law_force(const vi_contact_law *law, double penetration, double rate);

/* The form of a law's force with these parameters; VI_PRESS_NONE for a law that does not yield. */
static inline vi_press vi_law_press(const vi_law *law, const vi_contact_law *given)
{
    const double exponent = law->exponent > 0.0 ? law->exponent : given->exponent;
    return (vi_press){law->press, 0.0, given->stiffness, law->damped ? given->damping : 0.0, exponent};
}

/* Force of a law that yields, in this form; all zero without penetration (m, > 0) or where it would pull. */
static inline vi_contact_force vi_law_force(const vi_law *law, const vi_press *press, double penetration, double rate)
{
    vi_contact_force f = {0.0, 0.0, 0.0};
    if (penetration > 0.0 && law->force != NULL) {
        f = law->force(press, penetration, rate);
    }
    return f.force > 0.0 ? f : (vi_contact_force){0.0, 0.0, 0.0};
}

/* Is the port unused? */
static inline bool vi_contact_law_is_none(int64_t law)
{
    return law == 0;
}

/* Take the law of a port away. */
static inline void vi_contact_law_clear(vi_contact_law *law)
{
    law->law = 0;
}

/* Is there a stop for which the body searches itself? */
static inline bool vi_contact_law_has_stop(int64_t law)
{
    return vi_law_of(law)->stop != VI_NO_STOP;
}

/* Does the stop answer with an impulse? */
static inline bool vi_contact_law_is_rigid(int64_t law)
{
    return vi_law_of(law)->stop == VI_RIGID_STOP;
}

/* Does the stop yield, and answer with a force? */
static inline bool vi_contact_law_yields(int64_t law)
{
    return vi_law_of(law)->stop == VI_YIELDING_STOP;
}

/* Does another FMU answer for the stop, or hit the point? */
static inline bool vi_contact_law_is_external(int64_t law)
{
    return vi_law_of(law)->external;
}

/* Is there a stop that another FMU answers for? */
static inline bool vi_contact_law_asks(int64_t law)
{
    return vi_contact_law_is_external(law) && vi_contact_law_has_stop(law);
}

/* Is there a stop whose law is evaluated here? */
static inline bool vi_contact_law_is_own(int64_t law)
{
    return !vi_contact_law_is_external(law) && vi_contact_law_has_stop(law);
}

/* +1 for a stop above the motion, -1 for a stop below. A displacement times this grows towards the stop. */
static inline double vi_contact_direction(int64_t side)
{
    return side == VI_SIDE_LOWER ? -1.0 : 1.0;
}

#endif
