/* Partial derivatives of a random body. The equations carried back are the transposed ones, whatever its contacts do. A
 * call with random references, orders and sizes is right, or an error with one line. */
#define VI_STATES VI_STATES_OF_IMPORTER /* the core has a number of this name */
#include "../../fmus/native/adapters/derivatives.c"
#define is_finite is_finite_of_numbers
#include "../../fmus/native/adapters/instance.c"
#include "../../fmus/native/adapters/model_exchange.c"
#include "../../fmus/native/adapters/resources.c"
#undef VI_STATES
#define place_of_state place_of_state_of_body
#include "../../fmus/native/bodies/body_derivatives.c"
#define form form_of_rates
#include "../../fmus/native/bodies/body_rates.c"
#undef form

#include "body/modal/structure/structure.h"
#include "check.h"

typedef struct {
    double time, force, fixed;
    vi_body body;
} thing;

enum { TIME, FORCE, FIXED, DISPLACEMENT, VELOCITY, ACCELERATION, CONTACT_FORCE, IMPULSE, APPLIED, COUNT, STATES };

#define STATE(member, index) {VI_FLOAT64, VI_SET_STATE, 1, (uint32_t)(offsetof(thing, body.state.member) + (index) * sizeof(double))}

static const vi_variable thing_variables[] = {
    {VI_FLOAT64, VI_READ_ONLY, 1, offsetof(thing, time)},
    {VI_FLOAT64, VI_SET_INPUT, 1, offsetof(thing, force)},
    {VI_FLOAT64, VI_SET_INITIAL, 1, offsetof(thing, fixed)},
    {VI_FLOAT64, VI_READ_ONLY, 1, offsetof(thing, body.displacement)},
    {VI_FLOAT64, VI_READ_ONLY, 1, offsetof(thing, body.velocity)},
    {VI_FLOAT64, VI_READ_ONLY, 1, offsetof(thing, body.acceleration)},
    {VI_FLOAT64, VI_READ_ONLY, 1, offsetof(thing, body.contacts[1].force)},
    {VI_FLOAT64, VI_READ_ONLY, 1, offsetof(thing, body.contacts[1].total_impulse)},
    {VI_FLOAT64, VI_SET_INPUT, 1, offsetof(thing, body.contacts[1].applied_force)},
    {VI_INT64, VI_READ_ONLY, 1, offsetof(thing, body.contacts[1].count)},
    STATE(q, 0), STATE(p, 0), STATE(q, 1), STATE(p, 1), STATE(q, 2), STATE(p, 2),
};
enum { VARIABLES = sizeof thing_variables / sizeof thing_variables[0], MODES = 3, CONTACTS = 4 };
static const uint32_t thing_states[] = {STATES, STATES + 2, STATES + 4, STATES + 1, STATES + 3, STATES + 5};

const vi_description vi_this_description = {
    .token = "{token}",
    .struct_size = sizeof(thing),
    .time = offsetof(thing, time),
    .variables = thing_variables,
    .variable_count = VARIABLES,
    .states = thing_states,
    .state_count = 2 * MODES,
};

static void defaults(void *self)
{
    (void)self;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    (void)self;
    (void)start_time;
    return message != NULL;
}

static void update(void *self)
{
    (void)self;
}

static void show_states(void *self, vi_exchange_body *body)
{
    (void)self;
    body->modes = MODES;
    body->scale = 2.0;
}

static bool own_column(void *self, size_t offset, vi_line *line)
{
    line->load = 1.0;
    return offset == offsetof(thing, force) && vi_body_line_of_mode(vi_body_of(self), line, 1, 0.5);
}

static bool own_row(void *self, size_t offset, vi_line *line)
{
    (void)self;
    (void)offset;
    (void)line;
    return false;
}

static double base_forcing(const void *self)
{
    return ((const thing *)self)->fixed;
}

const vi_body_form vi_this_body = {.place = offsetof(thing, body),
                                   .show_states = show_states,
                                   .base_forcing = base_forcing,
                                   .column = own_column,
                                   .row = own_row};

const vi_component vi_this_component = {
    .defaults = defaults, .initialize = initialize, .update_outputs = update, .partial = &vi_body_derivatives};

vi_body *vi_body_of(void *self)
{
    return &((thing *)self)->body;
}

vi_structure vi_body_parts(vi_body *c)
{
    return (vi_structure){&c->model, &c->state, c->contacts, &c->record, NULL, NULL, NULL, NULL, {0, NULL, NULL, NULL}, NULL};
}

void vi_body_refresh_inputs(void *self)
{
    (void)self;
}

/* A body that presses some stops, rests on others, and is off the rest. */
static void make_random(uint64_t *seed, thing *t)
{
    static const int32_t STATUS[] = {VI_CONTACT_FREE, VI_CONTACT_HELD, VI_CONTACT_YIELDING, VI_CONTACT_RECEDING};
    vi_structure_model *model = &t->body.model;
    memset(t, 0, offsetof(thing, body.pressed));
    model->modes = MODES;
    model->contacts = (int32_t)choice(seed, CONTACTS + 1);
    model->coupled = (int32_t)choice(seed, 2);
    for (int j = 0; j < MODES; ++j) {
        vi_structure_mode(model, j, uniform(seed, 0.0, 3.0) + (double)j, uniform(seed, 0.0, 0.5), 0.0, 1.0);
        model->observed[j] = uniform(seed, -1.0, 1.0);
        t->body.state.q[j] = uniform(seed, -1.0, 1.0);
        t->body.state.p[j] = uniform(seed, -1.0, 1.0);
        for (int i = 0; i < MODES; ++i) {
            model->coupling[j][i] = uniform(seed, -1.0, 1.0);
        }
        for (int k = 0; k < CONTACTS; ++k) {
            model->shape[k][j] = model->impulse[k][j] = uniform(seed, -1.0, 1.0);
        }
    }
    for (int k = 0; k < CONTACTS; ++k) {
        vi_contact *contact = &t->body.contacts[k];
        contact->law = (vi_contact_law){.law = 1 + choice(seed, 7), .stiffness = 2.0, .damping = 0.1, .exponent = 1.7};
        contact->side = choice(seed, 2) == 0 ? VI_SIDE_UPPER : VI_SIDE_LOWER;
        contact->position = uniform(seed, -1.0, 1.0);
        contact->applied_stiffness = uniform(seed, 0.0, 3.0);
        model->stop[k] = vi_law_of(contact->law.law)->stop;
        model->press[k] = vi_law_press(vi_law_of(contact->law.law), &contact->law);
        t->body.state.status[k] = STATUS[choice(seed, 4)];
    }
    vi_structure_prepare(model);
}

static void randomise(uint64_t *seed, vi_variation *change)
{
    memset(change, 0, sizeof *change);
    change->base = uniform(seed, -1.0, 1.0);
    for (int j = 0; j < MODES; ++j) {
        change->displacement[j] = uniform(seed, -1.0, 1.0);
        change->velocity[j] = uniform(seed, -1.0, 1.0);
        change->load[j] = uniform(seed, -1.0, 1.0);
    }
    for (int k = 0; k < CONTACTS; ++k) {
        change->contact[k] = uniform(seed, -1.0, 1.0);
    }
}

static double scalar_product(const vi_variation *a, const vi_variation *b, double *size)
{
    double sum = a->base * b->base;
    *size = fabs(sum);
    for (int j = 0; j < MODES; ++j) {
        sum += a->displacement[j] * b->displacement[j] + a->velocity[j] * b->velocity[j] + a->load[j] * b->load[j];
        *size += fabs(a->displacement[j] * b->displacement[j]) + fabs(a->velocity[j] * b->velocity[j])
                 + fabs(a->load[j] * b->load[j]);
    }
    for (int k = 0; k < CONTACTS; ++k) {
        sum += a->contact[k] * b->contact[k];
        *size += fabs(a->contact[k] * b->contact[k]);
    }
    return sum;
}

static void carried_back_is_transposed(uint64_t *seed)
{
    static thing t;
    for (int n = 0; n < 20000; ++n) {
        vi_variation known, unknown, carried, back;
        double size, other;
        make_random(seed, &t);
        randomise(seed, &known);
        randomise(seed, &unknown);
        carried = known;
        back = unknown;
        carry(&t, &carried);
        carry_back(&t, &back);
        const double along = scalar_product(&unknown, &carried, &size);
        const double against = scalar_product(&back, &known, &other);
        /* more stops than modes: their shares are softened, which costs digits */
        CHECK(fabs(along - against) <= 1e-7 * (size + other), "%.17g and %.17g", along, against);
    }
}

static int lines;

static void count_lines(const vi_instance *instance, int level, const char *category, const char *text)
{
    (void)instance;
    CHECK((level == 1 || level == 3) && category != NULL && strlen(text) > 0, "level %d", level);
    lines += 1;
}

static void random_calls_are_errors_or_right(uint64_t *seed)
{
    vi_instance *instance = vi_instance_new("thing");
    CHECK(instance != NULL, "%s", "memory");
    instance->log = count_lines;
    for (int n = 0; n < 50000; ++n) {
        const size_t unknowns = choice(seed, 6), knowns = choice(seed, 6), most = 6;
        static uint32_t from[6], to[6];
        double seeds[6], found[6];
        make_random(seed, instance->self);
        const bool again = choice(seed, 3) == 0; /* the references of the last call */
        for (size_t i = 0; i < most; ++i) {
            seeds[i] = uniform(seed, -1.0, 1.0);
            if (again) {
                continue;
            }
            from[i] = choice(seed, 30) == 0 ? (uint32_t)next_random(seed) : choice(seed, VARIABLES);
            to[i] = choice(seed, 30) == 0 ? (uint32_t)next_random(seed) : choice(seed, VARIABLES);
        }
        const bool back = choice(seed, 2) == 0;
        const size_t wrong = choice(seed, 10) == 0 ? 1 : 0;
        const vi_derivative_call call = {to, choice(seed, 20) == 0 ? NULL : from, unknowns, knowns, seeds,
                                         (back ? unknowns : knowns) + wrong, found, back ? knowns : unknowns, back};
        instance->mode = (vi_mode_of_use)(1 << choice(seed, 7));
        const int before = lines;
        const vi_status status = vi_instance_derive(instance, "derive", &call);
        CHECK(lines == before + (status == VI_OK ? 0 : 1), "%d lines for one call", lines - before);
        const int32_t orders[] = {(int32_t)choice(seed, 4), 1, 2, (int32_t)choice(seed, 3), 1, 2};
        const vi_status over_time = vi_instance_differentiate(instance, "differentiate", choice(seed, 20) == 0 ? NULL : to,
                                                              orders, found, unknowns);
        CHECK(lines == before + (status == VI_OK ? 0 : 1) + (over_time == VI_OK ? 0 : 1), "%d lines for two calls",
              lines - before);
    }
    vi_instance_free(instance);
}

int main(void)
{
    uint64_t seed = 54;
    carried_back_is_transposed(&seed);
    random_calls_are_errors_or_right(&seed);
    return 0;
}
