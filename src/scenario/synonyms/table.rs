//! The table of names of Stable-Baselines3, CleanRL, RLlib, Tianshou and Spinning Up.

/// Names that mean the same.
pub(super) struct Synonym {
    /// The names in lower case, without `_` and `-`.
    pub(super) names: &'static [&'static str],
    /// What it is here.
    pub(super) meaning: &'static str,
    /// Forms, of which the first counts that a scenario accepts; each has assignments that belong
    /// together. `{}` is the value.
    pub(super) forms: &'static [&'static [&'static str]],
    /// A value, if none is given that fits.
    pub(super) example: &'static str,
}

/// The forms of the environment, whose value is a name of a task.
pub(super) const ENVIRONMENT: &[&[&str]] = &[&["environment={}"]];

/// The forms of the algorithm, whose value is a name in [`ALGORITHMS`].
pub(super) const ALGORITHM: &[&[&str]] = &[&["algorithm={}"]];

const fn field(
    names: &'static [&'static str],
    meaning: &'static str,
    forms: &'static [&'static [&'static str]],
    example: &'static str,
) -> Synonym {
    Synonym {
        names,
        meaning,
        forms,
        example,
    }
}

/// Names of fields.
pub(super) const FIELDS: &[Synonym] = &[
    field(
        &["lr", "learningrate", "stepsize", "adamlr"],
        "step size of the optimizer",
        &[
            &[
                "algorithm.policy_optimizer.step_size={}",
                "algorithm.value_optimizer.step_size={}",
            ],
            &[
                "algorithm.policy_optimizer.step_size={}",
                "algorithm.critic_optimizer.step_size={}",
            ],
            &["algorithm.learning.optimizer.step_size={}"],
            &["algorithm.network.optimizer.step_size={}"],
        ],
        "0.001",
    ),
    field(
        &["alpha"],
        "weight of the policy's entropy with `SeedSac`, otherwise a step size",
        &[
            &["algorithm.temperature=Fixed(alpha: {})"],
            &["algorithm.learning.optimizer.step_size={}"],
            &[
                "algorithm.policy_optimizer.step_size={}",
                "algorithm.value_optimizer.step_size={}",
            ],
        ],
        "0.001",
    ),
    field(
        &["pilr", "actorlr", "policylr"],
        "the policy has an optimizer of its own",
        &[&["algorithm.policy_optimizer.step_size={}"]],
        "0.001",
    ),
    field(
        &[
            "vfcoef",
            "vfcoeff",
            "vflosscoeff",
            "valuecoef",
            "valuelosscoef",
        ],
        "there is no weight of the value loss: policy and value function have networks and optimizers of their own",
        &[],
        "",
    ),
    field(
        &["targetkl", "clipvloss", "clipvalueloss", "kltarget"],
        "there is no such limit: updates are limited by `policy_loss: Ppo(clip: 0.2)` and `gradient_clip`",
        &[],
        "",
    ),
    field(
        &["policyfrequency", "policydelay"],
        "policy and critics take each gradient step together",
        &[],
        "",
    ),
    field(
        &["autotune", "targetentropy"],
        "the temperature of `SeedSac` is learned, unless it is given: `temperature: Fixed(alpha: 0.2)`",
        &[],
        "",
    ),
    field(
        &[
            "intcoef",
            "rndcoef",
            "beta",
            "eta",
            "bonusweight",
            "intrinsicweight",
        ],
        "weight of the exploration bonus, relative to the rewards",
        &[&["algorithm.bonus.scale.weight={}"]],
        "0.1",
    ),
    field(
        &["vflr", "criticlr", "qlr", "valuelr"],
        "the value function has an optimizer of its own",
        &[
            &["algorithm.value_optimizer.step_size={}"],
            &["algorithm.critic_optimizer.step_size={}"],
            &["algorithm.learning.optimizer.step_size={}"],
        ],
        "0.001",
    ),
    field(
        &["gamma", "discountfactor", "discountrate"],
        "discount factor",
        &[
            &["algorithm.discount={}"],
            &["algorithm.learning.discount={}"],
        ],
        "0.99",
    ),
    field(
        &[
            "agents",
            "nagents",
            "numagents",
            "population",
            "populationsize",
            "popsize",
            "teamsize",
        ],
        "number of agents, each of which plays in its own copy of the environment",
        &[&["agents.count={}"]],
        "16",
    ),
    field(
        &[
            "nenvs",
            "numenvs",
            "nenv",
            "numenv",
            "envs",
            "nworkers",
            "numworkers",
            "workers",
            "numenvrunners",
            "numrolloutworkers",
        ],
        "one learner in several copies is here one agent that plays several episodes before it learns; `agents.count` is the \
         number of learners",
        &[
            &["schedule=Synchronous(episodes: {})"],
            &["agents.count={}"],
        ],
        "4",
    ),
    field(
        &[
            "totaltimesteps",
            "timesteps",
            "totalsteps",
            "numtimesteps",
            "ntimesteps",
            "envsteps",
            "totalenvsteps",
            "maxtimesteps",
            "maxsteps",
            "timestepstotal",
            "numenvsteps",
            "steps",
        ],
        "number of steps of the whole team after which the run ends",
        &[&["stop=Steps(team: {}, at_most: 100000)"]],
        "100000",
    ),
    field(
        &[
            "episodes",
            "nepisodes",
            "numepisodes",
            "maxepisodes",
            "totalepisodes",
            "stop",
            "epochstotal",
            "iterations",
        ],
        "number of episodes per agent after which the run ends",
        &[&["stop=Episodes({})"], &["episodes={}"]],
        "500",
    ),
    field(
        &["sigma", "seedsigma", "seedscale"],
        "standard deviation of the agents' reward seeds",
        &[&["agents.seeds=Normal(sigma: {})"]],
        "0.1",
    ),
    field(
        &["threads", "nthreads", "numthreads", "ncpus", "numcpus"],
        "an option of the command line, `--threads 2`: results do not depend on it",
        &[],
        "",
    ),
    field(
        &["randomseed", "randomstate", "rngseed", "seeds", "runseed"],
        "run seed, also `--seed`; `seedbed bench` and studies have several",
        &[&["seed={}"]],
        "3",
    ),
    field(
        &[
            "batchsize",
            "minibatchsize",
            "minibatch",
            "trainbatchsize",
            "sgdminibatchsize",
        ],
        "number of transitions per gradient step",
        &[
            &["algorithm.learning.minibatch={}"],
            &["algorithm.minibatch=Steps({})"],
            &["algorithm.minibatch={}"],
        ],
        "64",
    ),
    field(
        &["nminibatches", "numminibatches"],
        "the size of a minibatch is given, not their number: `minibatch: Steps(64)`, steps of an update divided by their number",
        &[],
        "",
    ),
    field(
        &[
            "buffersize",
            "replaysize",
            "replaybuffersize",
            "memorysize",
            "capacity",
            "buffer",
            "replay",
        ],
        "number of transitions that are kept; algorithms without a replay buffer learn from the newest round",
        &[
            &["algorithm.learning.replay={}"],
            &["algorithm.replay={}"],
            &["algorithm.transitions={}"],
        ],
        "100000",
    ),
    field(
        &[
            "netarch",
            "hiddensizes",
            "hiddensize",
            "hiddenlayers",
            "hiddenunits",
            "fcnethiddens",
            "layers",
            "policykwargs",
            "policy",
            "network",
            "arch",
            "hidden",
        ],
        "networks are fully connected, with this number of units in each hidden layer",
        &[&["algorithm.hidden={}"], &["algorithm.learning.hidden={}"]],
        "[64, 64]",
    ),
    field(
        &[
            "entcoef",
            "entcoeff",
            "entropycoef",
            "entropycoeff",
            "entropycoefficient",
            "entropy",
            "entropybeta",
        ],
        "weight of the policy's entropy; algorithms without it explore in other ways: `seedbed list algorithms`",
        &[
            &["algorithm.entropy_bonus={}"],
            &["algorithm.temperature=Fixed(alpha: {})"],
        ],
        "0.01",
    ),
    field(
        &[
            "cliprange",
            "clipcoef",
            "clipparam",
            "clip",
            "clipratio",
            "epsclip",
            "epsilonclip",
            "clipepsilon",
        ],
        "clipping range of PPO",
        &[&["algorithm.policy_loss.clip={}"], &["algorithm.clip={}"]],
        "0.2",
    ),
    field(
        &[
            "nsteps",
            "numsteps",
            "rolloutlength",
            "rolloutfragmentlength",
            "stepsperepoch",
            "steppercollect",
            "horizonlength",
            "unrolllength",
        ],
        "agents learn from whole episodes; this is their number per agent and round",
        &[
            &["schedule=Synchronous(episodes: 4)"],
            &["agents.starts=Together"],
        ],
        "",
    ),
    field(
        &[
            "trainfreq",
            "trainfrequency",
            "updateevery",
            "learnevery",
            "updatefreq",
            "updatefrequency",
        ],
        "number of steps between two updates, for value-based learners",
        &[
            &["schedule=Lockstep(learn_every: {})"],
            &["schedule=Synchronous(episodes: {})"],
        ],
        "4",
    ),
    field(
        &[
            "nepochs",
            "updateepochs",
            "numepochs",
            "numsgditer",
            "ppoepochs",
            "kepochs",
            "gradientsteps",
            "nupdates",
            "utdratio",
        ],
        "number of passes over the episodes of a round, or of gradient steps",
        &[
            &["algorithm.epochs={}"],
            &["algorithm.updates={}"],
            &["algorithm.learning.minibatches={}"],
            &["algorithm.minibatches={}"],
        ],
        "4",
    ),
    field(
        &["gaelambda", "lambda", "lam", "lmbda", "lambd"],
        "trace parameter of advantages",
        &[
            &["algorithm.lambda={}"],
            &[
                "algorithm.advantage.lambda={}",
                "algorithm.value_target.lambda={}",
            ],
            &["algorithm.advantage.lambda={}"],
            &[
                "algorithm.policy_data=Own",
                "algorithm.value_data=Own",
                "algorithm.value_target=Gae(lambda: {})",
                "algorithm.advantage=Gae(lambda: {})",
            ],
        ],
        "0.95",
    ),
    field(
        &[
            "maxgradnorm",
            "gradclip",
            "gradientclipping",
            "clipgradnorm",
            "gradnorm",
            "clipnorm",
        ],
        "maximal norm of the gradient",
        &[
            &["algorithm.gradient_clip={}"],
            &["algorithm.learning.gradient_clip={}"],
        ],
        "0.5",
    ),
    field(
        &[
            "targetupdateinterval",
            "targetnetworkfrequency",
            "targetupdate",
            "targetupdatefreq",
            "targetnetworkupdatefreq",
        ],
        "the target network is copied after a number of gradient steps",
        &[&["algorithm.learning.target_every={}"]],
        "1000",
    ),
    field(
        &["tau", "polyak"],
        "how fast target networks follow the trained ones",
        &[
            &["algorithm.target_rate={}"],
            &["algorithm.learning.target_every=1000"],
        ],
        "0.005",
    ),
    field(
        &[
            "epsilon",
            "eps",
            "explorationfraction",
            "explorationinitialeps",
            "explorationfinaleps",
            "epsstart",
            "epsend",
            "epsdecay",
            "starte",
            "ende",
            "epsilongreedy",
        ],
        "how actions are chosen from values",
        &[
            &["algorithm.exploration=EpsilonGreedy(from: 1, to: 0.05, steps: 10000)"],
            &["algorithm=EpsilonGreedy(epsilon: 0.1)"],
        ],
        "",
    ),
    field(
        &[
            "normalizeobs",
            "normobs",
            "normalize",
            "normalizeobservation",
            "observationfilter",
            "normalizeobservations",
        ],
        "how observations are scaled for the networks",
        &[
            &["algorithm.observations=Running"],
            &["algorithm.learning.observations=Running"],
        ],
        "",
    ),
    field(
        &["normadv", "normalizeadvantage", "advnorm", "standardize"],
        "over which samples advantages are standardized",
        &[&["algorithm.standardize=PerMinibatch"]],
        "",
    ),
    field(
        &["anneallr", "lrschedule", "lrdecay"],
        "how step sizes change from round to round",
        &[&["algorithm.step_size_schedule=Linear(rounds: 200, to: 0)"]],
        "",
    ),
    field(
        &[
            "env",
            "envid",
            "envname",
            "environmentname",
            "environment",
            "task",
            "gymid",
            "gym",
        ],
        "the task",
        ENVIRONMENT,
        "cartpole",
    ),
    field(
        &[
            "algo",
            "algorithmname",
            "algorithm",
            "agent",
            "agentclass",
            "model",
            "trainer",
            "method",
        ],
        "how the agents learn; `seedbed list algorithms` has all",
        ALGORITHM,
        "QLearning",
    ),
    field(
        &[
            "maxepisodesteps",
            "timelimit",
            "episodelength",
            "maxeplen",
            "maxepisodelength",
        ],
        "the time limit is a field of the task: `seedbed list environments --show NAME > envs/mine.ron`, and \
         edit `time_limit`",
        &[],
        "",
    ),
    field(
        &["device", "cuda", "gpu", "usegpu", "numgpus"],
        "runs use the processor only; `--threads N` sets the number of threads",
        &[],
        "",
    ),
    field(
        &["verbose", "verbosity", "loglevel", "progressbar"],
        "`--quiet` prints nothing but errors and warnings",
        &[],
        "",
    ),
    field(
        &[
            "tensorboardlog",
            "logdir",
            "savepath",
            "savemodel",
            "capturevideo",
            "outputdir",
            "wandb",
            "track",
            "savefreq",
            "evalfreq",
            "tblogname",
        ],
        "every run is recorded, by `--out DIR` in a directory of your own; `seedbed export`, `film` and \
         `evaluate` read it",
        &[],
        "",
    ),
    field(
        &[
            "learningstarts",
            "warmup",
            "warmupsteps",
            "startsteps",
            "randomsteps",
        ],
        "learning begins when the replay buffer has a minibatch, with `SeedSac` after its random steps",
        &[&["algorithm.random_steps={}"]],
        "1000",
    ),
];

/// Names of algorithms.
pub(super) const ALGORITHMS: &[Synonym] = &[
    field(
        &["ppo", "trpo", "ppo2", "appo", "ippo", "mappo"],
        "`SeedPg` with its loss `Ppo`; the scenario `ppo` has the usual settings for any task, here without the schedule",
        &[&[
            "algorithm=SeedPg(value_data: Own, policy_data: Own, value_target: Gae(lambda: 0.95), advantage: Gae(lambda: 0.95), time_limit: Bootstraps, standardize: PerMinibatch, observations: Running, hidden: [64, 64], policy_scale: 0.01, epochs: 10, minibatch: Steps(64), gradient_clip: Some(0.5), policy_optimizer: (step_size: 0.0003), value_optimizer: (step_size: 0.0003))",
        ]],
        "",
    ),
    field(
        &[
            "a2c",
            "a3c",
            "actorcritic",
            "ac",
            "reinforce",
            "vpg",
            "pg",
            "policygradient",
            "impala",
        ],
        "`SeedPg` with its loss `SimplePg`, on the agent's own episodes",
        &[&["algorithm=SeedPg(policy_data: Own, policy_loss: SimplePg)"]],
        "",
    ),
    field(
        &[
            "sac", "td3", "ddpg", "tqc", "mpo", "crossq", "redq", "droq", "seedsac",
        ],
        "`SeedSac`, for tasks with continuous actions",
        &[&["algorithm=SeedSac()"]],
        "",
    ),
    field(
        &[
            "dqn",
            "ddqn",
            "doubledqn",
            "duelingdqn",
            "qrdqn",
            "rainbow",
            "c51",
            "iqn",
            "q",
            "sarsa",
            "qlearning",
        ],
        "`QLearning`, for tasks with one discrete action",
        &[
            &["algorithm=QLearning()"],
            &["algorithm=EpsilonGreedy(epsilon: 0.1)"],
        ],
        "",
    ),
    field(
        &[
            "bootdqn",
            "bootstrapped",
            "bootstrappeddqn",
            "bdqn",
            "randomizedpriors",
            "rpf",
        ],
        "`BootstrappedDqn`, for tasks with one discrete action",
        &[&["algorithm=BootstrappedDqn()"]],
        "",
    ),
    field(
        &["seedensemble", "seedlsvi", "rlsvi", "seedtd"],
        "`SeedTd`, for tasks with one discrete action",
        &[&["algorithm=SeedTd()"]],
        "",
    ),
    field(
        &["hyperagent", "hypermodel", "epinet", "enn", "hyperdqn"],
        "`HyperAgent`, for tasks with one discrete action",
        &[&["algorithm=HyperAgent()"]],
        "",
    ),
    field(
        &[
            "psrl",
            "posteriorsampling",
            "pets",
            "mbpo",
            "dreamer",
            "dreamerv3",
            "thompson",
            "seedpsrl",
        ],
        "`SeedPsrl`; in tabular scenarios `SampleOnce`",
        &[&["algorithm=SeedPsrl()"], &["algorithm=SampleOnce"]],
        "",
    ),
    field(
        &[
            "cem",
            "crossentropymethod",
            "crossentropy",
            "es",
            "cmaes",
            "evolution",
            "ars",
        ],
        "`CrossEntropy`",
        &[&["algorithm=CrossEntropy()"]],
        "",
    ),
    field(
        &["sapg", "leaderfollowers"],
        "`LeaderFollowers`",
        &[&["algorithm=LeaderFollowers()"]],
        "",
    ),
    field(
        &["rnd", "icm", "curiosity"],
        "an exploration bonus of another algorithm",
        &[
            &["algorithm=SeedPg(bonus: Rnd())"],
            &["algorithm=CountBonus()"],
        ],
        "",
    ),
    field(
        &["vime"],
        "an exploration bonus of another algorithm",
        &[&["algorithm=SeedPg(bonus: Vime())"]],
        "",
    ),
    field(
        &["seedpg", "seedsampling"],
        "names of algorithms begin with capitals",
        &[&["algorithm=SeedPg()"], &["algorithm=SeedSampling()"]],
        "",
    ),
    field(
        &["ucrl", "ucrl2", "ucb", "ucbvi"],
        "`Ucrl`, in tabular scenarios",
        &[&["algorithm=Ucrl()"]],
        "",
    ),
    field(
        &["random", "randomagent", "uniform"],
        "`Random`",
        &[&["algorithm=Random"]],
        "",
    ),
];
