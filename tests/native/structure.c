/* Random bodies of up to 64 modes with up to VI_PORTS stops of every law, including extreme ones. They stay finite, are
 * never beyond a rigid stop, never go back in time, and always end their steps. Stops only push. */
#include "body/modal/loads.h"
#include "body/modal/modal_scan.h"
#include "body/modal/power_tables.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/structure.h"

#include <math.h>
#include <string.h>

#include "body/modal/structure/impact.h"
#include "check.h"

enum { MANY = VI_PORTS > 8, RUNS = MANY ? 500 : 10000 }; /* many_contacts.c has fewer runs, with more contacts */

static const double RATIOS[] = {0.0, 0.01, 0.3, 1.0, 1.0, 3.0, 100.0};
static const double MASSES[] = {1e-9, 1e-3, 1.0, 1.0, 1.0, 1e3, 1e9};
static const double STIFFNESSES[] = {1.0, 1e2, 1e4, 1e6, 1e10, 1e15};
static const double RESTITUTIONS[] = {0.0, 1e-12, 0.5, 0.7, 0.9, 0.999, 1.0};
static const double GAPS[] = {0.0, 1e-9, 1e-3, 0.1, 1.0};
static const char *const LAWS[] = {"none",  "restitution",   "restitution", "kelvin_voigt",
                                   "hertz", "hunt_crossley", "pair"};

#define ANY(table) table[choice(seed, (unsigned)(sizeof table / sizeof table[0]))]

static vi_structure_model model;
static vi_structure_state state;
static vi_contact contacts[VI_PORTS];
static vi_record record;
static vi_pressed_cache pressed;
static vi_scan scan;
static vi_power_tables power;
static vi_signal_loads loads;
static const vi_structure body = {&model, &state, contacts, &record, &pressed, &scan, &power, &loads, {0, NULL, NULL, NULL}, NULL};

#if VI_SIGNALS > 0

enum { LOADS = 3 };

static double amplitude[LOADS], load_force[LOADS][VI_MODES];

/* Up to three signals of time: a random one, a chirp and a pulse. */
static void make_loads(uint64_t *seed, double root)
{
    const double rate = pow(10.0, uniform(seed, 0.0, 4.0));
    loads.count = (int32_t)choice(seed, LOADS + 1);
    loads.amplitude = amplitude;
    loads.force = (const double (*)[VI_MODES])load_force;
    for (int k = 0; k < loads.count; ++k) {
        amplitude[k] = k == 0 || choice(seed, 2) == 0 ? uniform(seed, -1.0, 1.0) : 0.0;
        for (int j = 0; j < model.modes; ++j) {
            load_force[k][j] = root * uniform(seed, -1.0, 1.0);
        }
        loads.signal[k] = (vi_signal){
            .kind = k == 0 ? VI_RANDOM : k == 1 ? VI_CHIRP_LINEAR : VI_HALF_SINE, .start = uniform(seed, -1.0, 10.0) / rate,
            .duration = k == 0 ? 0.0 : uniform(seed, 1.0, 50.0) / rate, .end_angular_frequency = rate,
            .seed = next_random(seed), .random = &loads.random[k], .transform = &loads.transform};
        vi_signal_prepare(&loads.signal[k]);
    }
}

static void remove_loads(void)
{
    loads.count = 0;
}

#else

static void make_loads(uint64_t *seed, double root)
{
    (void)seed;
    (void)root;
}

static void remove_loads(void)
{
}

#endif

static void make_modes(uint64_t *seed, double root)
{
    const double w = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.1, 5.0), growth = uniform(seed, 1.0, 1.2);
    const bool alike = choice(seed, 2) == 0;
    const double ratio = ANY(RATIOS);
    double natural = choice(seed, 20) == 0 ? 0.0 : uniform(seed, 0.2, 3.0);
    for (int j = 0; j < model.modes; ++j) {
        const double force = w > 0.0 ? root * uniform(seed, -1.0, 1.0) : 0.0;
        vi_structure_mode(&model, j, natural, natural > 0.0 ? (alike ? ratio : ANY(RATIOS)) : 0.0, force, w);
        natural = natural * growth + uniform(seed, 0.0, 1.0);
        state.q[j] = root * uniform(seed, -1.0, 1.0) / (1.0 + (double)(j * j));
        state.p[j] = choice(seed, 3) == 0 ? 0.0 : root * uniform(seed, -1.0, 1.0) / (1.0 + (double)j);
        model.observed[j] = 1.0 / root;
    }
    CHECK(vi_clock_start(&model.clock, w, uniform(seed, -3.0, 3.0), 1.0), "%s", "clock");
}

static void make_stop(uint64_t *seed, int k, double mass, double root)
{
    vi_contact *contact = &contacts[k];
    const bool twin = k > 0 && choice(seed, 8) == 0; /* same point as the stop before: redundant, or the other end of a
                                                      * gap */
    double displacement = 0.0;
    for (int j = 0; j < model.modes; ++j) {
        const double own = uniform(seed, -1.0, 1.0) / root;
        model.shape[k][j] = model.impulse[k][j] = twin ? model.shape[k - 1][j] : own;
        displacement += model.shape[k][j] * state.q[j];
    }
    const double r = ANY(RESTITUTIONS);
    contact->law = (vi_contact_law){vi_contact_law_number(ANY(LAWS)), r, choice(seed, 4) == 0 ? 0.1 : 0.0, mass * ANY(STIFFNESSES),
                                    0.0, uniform(seed, 1.0, 2.5)};
    contact->law.damping = vi_law_of(contact->law.law)->press == VI_PRESS_LINEAR
                               ? uniform(seed, 0.0, 2.0) * sqrt(contact->law.stiffness * mass)
                               : uniform(seed, 0.0, 1.0);
    contact->side = choice(seed, 2) == 0 ? VI_SIDE_UPPER : VI_SIDE_LOWER;
    contact->position = displacement + vi_contact_direction(contact->side) * ANY(GAPS);
    contact->relaxation_time = choice(seed, 4) == 0 ? 0.1 : 0.0;
}

static void make(uint64_t *seed)
{
    memset(&model, 0, sizeof model);
    memset(&state, 0, sizeof state);
    memset(contacts, 0, sizeof contacts);
    memset(&record, 0, sizeof record);
    model.modes = choice(seed, 12) == 0 ? VI_MODES : 1 + (int)choice(seed, 8);
    model.contacts = choice(seed, MANY ? 3 : 12) == 0 ? VI_PORTS : (int)choice(seed, 4);
    model.impact_limit = 200;
    model.tolerance = 1e-8;
    const double mass = ANY(MASSES), root = sqrt(mass);
    make_modes(seed, root);
    for (int k = 0; k < model.contacts; ++k) {
        make_stop(seed, k, mass, root);
    }
    state.follow_energies = (int32_t)choice(seed, 2);
    record.extrema = choice(seed, 4) == 0;
    vi_structure_prepare(&model);
    vi_structure_start(&body, (vi_instant){0, 0.0, 0.0});
    if (VI_SIGNALS > 0 && choice(seed, 4) == 0) {
        make_loads(seed, root);
    } else {
        remove_loads();
    }
    vi_structure_load(&body);
}

/* Largest rate of the body with all its stops pressed; a coupled motion is followed in pieces of about 1 / rate. */
static double fastest_rate(void)
{
    double rate = model.fastest;
    for (int k = 0; k < model.contacts; ++k) {
        const vi_contact_law *law = &contacts[k].law;
        const bool linear = vi_law_of(law->law)->press == VI_PRESS_LINEAR;
        rate += sqrt(law->stiffness * model.mobility[k][k]) + (linear ? law->damping * model.mobility[k][k] : 0.0);
    }
    return rate;
}

static void check_state(int run)
{
    double acceleration[VI_MODES];
    vi_structure_outputs(&body, acceleration);
    for (int j = 0; j < model.modes; ++j) {
        CHECK(isfinite(state.q[j]) && isfinite(state.p[j]) && isfinite(acceleration[j]), "run %d: mode %d: %g, %g, %g", run,
              j, state.q[j], state.p[j], acceleration[j]);
    }
    for (int k = 0; k < model.contacts; ++k) {
        double displacement = 0.0, size = fabs(contacts[k].position);
        for (int j = 0; j < model.modes; ++j) {
            displacement += model.shape[k][j] * state.q[j];
            size += fabs(model.shape[k][j] * state.q[j]);
        }
        const double beyond = vi_contact_direction(contacts[k].side) * (displacement - contacts[k].position);
        CHECK(!vi_contact_law_is_rigid(contacts[k].law.law) || beyond <= 1e-12 * size, "run %d: %g beyond stop %d", run, beyond,
              k + 1);
        CHECK(isfinite(contacts[k].force) && contacts[k].force >= 0.0, "run %d: stop %d: %g N", run, k + 1,
              contacts[k].force);
    }
    CHECK(isfinite(state.energies.contact_loss) && isfinite(state.energies.damping_loss), "run %d", run);
}

/* One event too many at an instant: a mass between two stops is thrown off the second stop. */
static void one_event_too_many_is_said(void)
{
    uint64_t seed = 1;
    char message[VI_MESSAGE_LENGTH] = "";
    do {
        make(&seed);
    } while (model.modes != 1 || model.contacts != 2);
    vi_structure_mode(&model, 0, 0.0, 0.0, 0.0, 0.0);
    remove_loads();
    for (int k = 0; k < 2; ++k) {
        model.shape[k][0] = model.impulse[k][0] = 1.0;
        contacts[k].law = vi_contact_law_rigid(0.5);
        contacts[k].side = k == 0 ? VI_SIDE_LOWER : VI_SIDE_UPPER;
        contacts[k].position = k == 0 ? -1.0 : 0.0;
    }
    state.q[0] = state.p[0] = 0.0;
    vi_structure_prepare(&model);
    vi_structure_start(&body, (vi_instant){0, 0.0, 0.0});
    const double pressed[VI_MODES] = {1.0}, pulled[VI_MODES] = {-1.0}, level[VI_MODES] = {0.0};
    const vi_step_request request = {0.0, 0.1, false, false};
    vi_structure_hold(&body, pressed, level);
    CHECK(vi_structure_advance(&body, vi_clock_after(&model.clock, state.now, 0.1), &request) == VI_STEP_DONE, "%s", "pressed");
    CHECK(state.status[1] == VI_CONTACT_HELD, "status %d", state.status[1]);
    vi_structure_hold(&body, pulled, level);
    state.standstill = (vi_standstill){state.now, VI_MOST_EVENTS - 1};
    state.status[1] = VI_CONTACT_YIELDING; /* thrown off a compliant stop: its contact ends at this instant */
    contacts[1].law = (vi_contact_law){vi_contact_law_number("kelvin_voigt"), 0.0, 0.0, 1.0, 1.0, 1.0};
    state.p[0] = -1.0;
    CHECK(vi_structure_advance(&body, vi_clock_after(&model.clock, state.now, 0.1), &request) == VI_STEP_STANDSTILL, "%s", "goes on");
    vi_structure_complain(&body, message);
    CHECK(strstr(message, "contact[2]") != NULL && strstr(message, "contact[1]") == NULL, "%s", message);
    CHECK(strstr(message, "1000 events at ") != NULL, "%s", message);
}

/* Another body hits a point: the point gets the impulse over its contact mass exactly once. */
static void strike(uint64_t *seed, int run)
{
    const int k = (int)choice(seed, (unsigned)model.contacts);
    const double wanted = uniform(seed, -1.0, 1.0), sign = vi_contact_direction(contacts[k].side);
    const double before = sign * vi_structure_approach(&body, k), size = vi_structure_velocity_size(&body, k);
    contacts[k].applied_impulse = model.mobility[k][k] > 0.0 ? wanted / model.mobility[k][k] : 0.0;
    for (int twice = 0; twice < 2; ++twice) {
        vi_structure_take_impulses(&body);
    }
    const double after = sign * vi_structure_approach(&body, k);
    CHECK(contacts[k].applied_impulse == 0.0, "run %d: an impulse is left", run);
    CHECK(model.mobility[k][k] == 0.0 || state.pending || fabs(after - before - wanted) <= 1e-12 * (size + 1.0),
          "run %d: %.17g after %.17g, expected %.17g more", run, after, before, wanted);
    for (int l = 0; l < model.contacts; ++l) {
        CHECK(state.pending || state.status[l] != VI_CONTACT_HELD, "run %d: still held", run);
    }
}

int main(int count, char **names)
{
    one_event_too_many_is_said();
    uint64_t seed = 4;
    int64_t impacts = 0;
    const int only = count > 1 ? atoi(names[1]) : -1; /* a single run to examine */
    for (int run = 0; run < RUNS; ++run) {
        uint64_t own = next_random(&seed);
        if (only >= 0 && run != only) {
            continue;
        }
        make(&own);
        if (vi_structure_beyond(&body) != 0) {
            continue; /* two stops from either side of a point, with a start between them only within rounding */
        }
        for (int n = 0; n < 6; ++n) {
            if (model.contacts > 0 && n % 3 == 1) {
                strike(&own, run);
            }
            const double size = pow(10.0, uniform(&own, -3.0, 2.0)) / fastest_rate(), before = vi_clock_time(&model.clock, state.now);
            const vi_step_request request = {before, size, false, false};
            const vi_step_result result = vi_structure_advance(&body, vi_clock_after(&model.clock, state.now, size), &request);
            CHECK(result != VI_STEP_STANDSTILL, "run %d stands still at %.17g", run, before);
            CHECK(vi_clock_time(&model.clock, state.now) >= before, "run %d: back from %.17g", run, before);
            record.taken = record.count;
            vi_record_take(&record);
            check_state(run);
        }
        for (int k = 0; k < model.contacts; ++k) {
            impacts += contacts[k].count;
        }
    }
    CHECK(only >= 0 || impacts > RUNS, "only %lld impacts: the runs are too short to say anything", (long long)impacts);
    return 0;
}
