"""Programs to read, run and copy:

    python -m smaclite_pool.examples.random_policy 2s3z            # steps per second of a random policy
    python -m smaclite_pool.examples.ppo 2s3z --steps 500000       # PPO in PyTorch (extra `torch`)
    python -m smaclite_pool.examples.self_play 3m                  # PPO of a team that plays itself
    python -m smaclite_pool.examples.value_decomposition 3m        # QMIX, VDN and IQL in PyTorch
    python -m smaclite_pool.examples.behaviour_cloning 3m.smdata   # imitation of a dataset, in PyTorch
    python -m smaclite_pool.examples.planning 5m_vs_6m             # beam search and MCTS over branches
    python -m smaclite_pool.examples.ray_rollouts 3m               # PPO with Ray's actors (extra `ray`)
    python -m smaclite_pool.examples.epymarl_speed EPYMARL/src     # EPyMARL with and without a pool

To change one, copy its file; this prints the folder:

    python -c "import smaclite_pool.examples as examples; print(*examples.__path__)"
"""
